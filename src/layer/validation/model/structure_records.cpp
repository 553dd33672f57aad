// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/structure_records.h"

#include <algorithm>
#include <cstring>

#include "layer/base/dispatch.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kRecords = 1u << 16;
constexpr uint32_t kBuckets = 1u << kReferenceBucketsLog2;
constexpr uint32_t kMostBuckets = kBuckets / 4; // so that probes end
constexpr VkDeviceSize kRecordBytes = sizeof(RecordWords);

// The key of a bucket that had a reference: no address is as high.
constexpr uint32_t kRemovedHigh = 0xffffffff;

// Shaders may probe at the same time: a bucket that is not the last one never seems to be empty.
void store(uint32_t &word, uint32_t value)
{
    __atomic_store_n(&word, value, __ATOMIC_RELEASE);
}

bool isRemoved(const uint32_t *words)
{
    return words[0] == 0 && words[1] == kRemovedHigh;
}

} // namespace

VkResult StructureRecords::create(const GpuContext &context)
{
    const VkResult result = records_.create(context, kRecords * kRecordBytes,
                                            VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    if (result != VK_SUCCESS)
        return result;
    records_.words()[kDestroyed * kStructureRecordWords] = kRecordDestroyed;
    records_.words()[kRecordAllReferences] = 1;
    return references_.create(context, VkDeviceSize{kBuckets} * kReferenceBucketWords * 4);
}

std::shared_ptr<StructureRecords::Owner> StructureRecords::take()
{
    std::lock_guard lock(mutex_);
    if (!records_.words() || (free_.empty() && used_ == kRecords))
        return nullptr;
    const uint32_t index = free_.empty() ? used_ : free_.back();
    auto owner = std::make_shared<Owner>(*this, index);
    if (free_.empty())
        ++used_;
    else
        free_.pop_back();
    std::memset(records_.words() + index * kStructureRecordWords, 0, kRecordBytes);
    return owner;
}

// A bucket's words by its number.
uint32_t *StructureRecords::bucket(uint32_t number)
{
    return references_.words() + VkDeviceSize{number & (kBuckets - 1)} * kReferenceBucketWords;
}

// The bucket of a reference; null if it has none, and `make` or the probes allow none.
uint32_t *StructureRecords::bucketOf(VkDeviceAddress reference, bool make)
{
    const auto low = static_cast<uint32_t>(reference);
    const auto high = static_cast<uint32_t>(reference >> 32);
    const uint32_t first = referenceBucket(low, high);
    uint32_t *unused = nullptr;
    for (uint32_t probe = 0; probe < kReferenceProbes; ++probe) {
        uint32_t *words = bucket(first + probe);
        if (words[0] == low && words[1] == high)
            return words;
        const bool isEmpty = words[0] == 0 && words[1] == 0;
        if (!unused && (isEmpty || isRemoved(words)))
            unused = words;
        if (isEmpty)
            break;
    }
    if (!make || !unused || buckets_ == kMostBuckets)
        return nullptr;
    ++buckets_;
    unused[2] = unused[3] = 0;
    store(unused[0], low);
    store(unused[1], high);
    return unused;
}

// Probes for other references go on behind it, unless an empty one follows.
void StructureRecords::remove(uint32_t *words)
{
    --buckets_;
    auto number = static_cast<uint32_t>((words - references_.words()) / kReferenceBucketWords);
    store(words[1], kRemovedHigh);
    store(words[0], 0);
    words[2] = words[3] = 0;
    const uint32_t *next = bucket(number + 1);
    if (next[0] != 0 || next[1] != 0)
        return;
    for (; isRemoved(bucket(number)); --number)
        bucket(number)[1] = 0;
}

void StructureRecords::setReference(VkDeviceAddress reference, const Owner &record)
{
    std::lock_guard lock(mutex_);
    if (reference == 0 || referenceOf_.contains(record.index()))
        return;
    uint32_t &owners = owners_[reference];
    referenceOf_[record.index()] = reference;
    ++owners;
    if (uint32_t *words = bucketOf(reference, true)) {
        // Two structures at one address: until both are gone it is unknown which of them an instance means.
        if (owners > 1)
            words[3] = 1;
        words[2] = words[3] == 0 ? record.index() : 0;
    } else {
        setIncomplete();
    }
}

void StructureRecords::setIncomplete()
{
    if (records_.words())
        records_.words()[kRecordAllReferences] = 0;
}

void StructureRecords::setDestroyed(const Owner &record)
{
    std::lock_guard lock(mutex_);
    const auto known = referenceOf_.find(record.index());
    if (known == referenceOf_.end())
        return;
    const VkDeviceAddress reference = known->second;
    const auto owners = owners_.find(reference);
    uint32_t *words = owners != owners_.end() && owners->second == 1 ? bucketOf(reference, false) : nullptr;
    if (!words)
        return removeReference(record.index());
    words[2] = kDestroyed;
    words[3] = 0;
    owners_.erase(owners);
    referenceOf_.erase(known);
    destroyed_.push_back(reference);
    if (destroyed_.size() <= kMostBuckets / 2)
        return;
    uint32_t *oldest = bucketOf(destroyed_.front(), false);
    if (oldest && oldest[2] == kDestroyed)
        remove(oldest);
    destroyed_.pop_front();
}

void StructureRecords::removeReference(const Owner &record)
{
    std::lock_guard lock(mutex_);
    removeReference(record.index());
}

void StructureRecords::removeReference(uint32_t index)
{
    const auto reference = referenceOf_.find(index);
    if (reference == referenceOf_.end())
        return;
    const auto owners = owners_.find(reference->second);
    if (owners == owners_.end() || --owners->second == 0) {
        if (uint32_t *words = bucketOf(reference->second, false))
            remove(words);
        owners_.erase(reference->second);
    }
    referenceOf_.erase(reference);
}

void StructureRecords::giveBack(uint32_t index)
{
    std::lock_guard lock(mutex_);
    free_.push_back(index);
    removeReference(index);
}

void StructureRecords::set(const DeviceTable &next, VkCommandBuffer commandBuffer, const Owner &record,
                           const RecordWords &words) const
{
    next.CmdUpdateBuffer(commandBuffer, records_.buffer(), record.index() * kRecordBytes, kRecordBytes, words.data());
}

void StructureRecords::copy(const DeviceTable &next, VkCommandBuffer commandBuffer, const Owner *from,
                            const Owner &to) const
{
    const VkBufferCopy region{(from ? from->index() : 0) * kRecordBytes, to.index() * kRecordBytes, kRecordBytes};
    if (region.srcOffset != region.dstOffset)
        next.CmdCopyBuffer(commandBuffer, records_.buffer(), records_.buffer(), 1, &region);
}

void StructureRecords::set(const Owner &record, const RecordWords &words)
{
    std::memcpy(records_.words() + record.index() * kStructureRecordWords, words.data(), kRecordBytes);
}

void StructureRecords::copy(const Owner *from, const Owner &to)
{
    RecordWords words{};
    if (from)
        std::memcpy(words.data(), records_.words() + from->index() * kStructureRecordWords, kRecordBytes);
    set(to, words);
}

} // namespace vellum::layer
