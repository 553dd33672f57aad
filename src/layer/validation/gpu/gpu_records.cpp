// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/gpu/gpu_records.h"

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

} // namespace

VkResult StructureRecords::create(const GpuContext &context)
{
    const VkResult result = records_.create(context, kRecords * kRecordBytes,
                                            VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    return result == VK_SUCCESS ? references_.create(context, VkDeviceSize{kBuckets} * kReferenceBucketWords * 4)
                                : result;
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

uint32_t *StructureRecords::bucketOf(VkDeviceAddress reference)
{
    const auto low = static_cast<uint32_t>(reference);
    const auto high = static_cast<uint32_t>(reference >> 32);
    uint32_t bucket = referenceBucket(low, high);
    for (uint32_t probe = 0; probe < kReferenceProbes; ++probe) {
        uint32_t *words = references_.words() + bucket * kReferenceBucketWords;
        if (words[0] == low && words[1] == high)
            return words;
        if (words[0] == 0 && words[1] == 0 && buckets_ < kMostBuckets) {
            ++buckets_;
            words[0] = low;
            words[1] = high;
            return words;
        }
        bucket = (bucket + 1) & (kBuckets - 1);
    }
    return nullptr;
}

void StructureRecords::setReference(VkDeviceAddress reference, const Owner &record)
{
    std::lock_guard lock(mutex_);
    if (uint32_t *bucket = reference ? bucketOf(reference) : nullptr) {
        // Two structures at one address: from now on it is unknown which of them an instance means.
        if (bucket[2] != 0 && bucket[2] != record.index())
            bucket[3] = 1;
        bucket[2] = bucket[3] == 0 ? record.index() : 0;
        referenceOf_[record.index()] = reference;
    }
}

void StructureRecords::giveBack(uint32_t index)
{
    std::lock_guard lock(mutex_);
    free_.push_back(index);
    const auto reference = referenceOf_.find(index);
    if (reference == referenceOf_.end())
        return;
    if (uint32_t *bucket = bucketOf(reference->second); bucket && bucket[2] == index)
        bucket[2] = 0;
    referenceOf_.erase(reference);
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
