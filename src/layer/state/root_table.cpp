// SPDX-License-Identifier: Apache-2.0
#include "layer/state/root_table.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <new>

#include "core/align.h"
#include "core/opacity.h"
#include "core/records.h"
#include "layer/base/undo.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr VkDeviceAddress kHeldKey = 2; // synthetic keys are this plus a multiple of 4
constexpr uint32_t kSlots = 1u << 24;   // instanceCustomIndex has 24 bits
constexpr VkDeviceSize kPageBytes = VkDeviceSize{kSlotsPerPage} * kInstanceRecordWords * 4;
// With a record of zeros every hit reaches the shader, except those in transparent micro-triangles.
static_assert(hitInTable(0, kStateNone) == kHitNonOpaque && hitInTable(0, kStateOpaque) == kHitNonOpaque);
// Shaders distinguish records of boxes from those of triangles by this bit (vellumCullsBox in lookup.comp).
static_assert((hitTable(0) & kInstanceBoxes) == 0);
static_assert(kFirstSlots <= kSlotsPerPage && kDirectoryPages * kSlotsPerPage == kSlots);
constexpr VkDeviceSize kRootBytes = (kRootHeaderWords + VkDeviceSize{kDirectoryPages} * 2) * 4;
constexpr uint32_t kFirstBuckets = 1024;
constexpr VkDeviceAddress kDeletedKey = ~VkDeviceAddress{0};

constexpr VkDeviceSize wholePages(VkDeviceSize bytes)
{
    return alignUp(bytes, FixedMemory::kAlignment);
}

// The tables whose addresses rewritten shaders contain, and their offsets in the fixed memory.
constexpr size_t kRoot = 0;
constexpr size_t kFirstPages = 1;
constexpr std::array<VkDeviceSize, KeptAddresses::kTables> kTableBytes{kRootBytes, kPageBytes};
constexpr std::array<size_t, KeptAddresses::kTables> kTableOffsets{0, wholePages(kRootBytes)};
constexpr size_t kFixedBytes = kTableOffsets[kFirstPages] + wholePages(kPageBytes);
static_assert(kFixedBytes <= FixedMemory::kMostBytes);

// The GPU may read the tables while the host changes them. This comes before each store that leads it to new data. A
// release alone does not order stores of x86 to write-combined memory, which device-local memory is mapped as.
void fenceBeforePublishing()
{
    std::atomic_thread_fence(std::memory_order_seq_cst);
}

// Writes both words at once; they are aligned, as all pairs of words are.
void store64(uint32_t *words, uint64_t value)
{
    __atomic_store_n(reinterpret_cast<uint64_t *>(words), value, __ATOMIC_RELEASE);
}

uint64_t load64(const uint32_t *words)
{
    return words[0] | uint64_t{words[1]} << 32;
}

// Returns the result of `function`, or a default value if host memory runs out.
template <typename Function>
auto orNothing(Function function) -> decltype(function())
{
    try {
        return function();
    } catch (const std::bad_alloc &) {
        return {};
    }
}

bool crossesWord(VkDeviceAddress address, VkDeviceSize bytes)
{
    return (address >> 32) != ((address + bytes - 1) >> 32);
}

uint32_t *bucketWords(const GpuBuffer &table, uint32_t bucket)
{
    return table.words() + size_t{bucket} * kHashBucketWords;
}

} // namespace

VkDeviceAddress SlotRange::recordAddress(uint32_t slot) const
{
    const uint32_t page = (slot >> kSlotsPerPageLog2) - (first_ >> kSlotsPerPageLog2);
    return pages_[page] + slot % kSlotsPerPage * VkDeviceSize{kInstanceRecordWords * 4};
}

SlotRange::~SlotRange()
{
    try {
        table_.freeSlots(first_, count_);
    } catch (const std::bad_alloc &) { // only the slots are lost
    }
}

VkResult RootTable::create(const GpuContext &context, const std::string &keptAddresses)
{
    context_ = context;
    if (context.importsHostMemory)
        fixed_.reserve(kFixedBytes);
    else if (context.replaysAddresses && !keptAddresses.empty())
        kept_.open(keptAddresses, kTableBytes);
    const VkResult result = createTable(root_, kRoot, true);
    if (result != VK_SUCCESS)
        return result;
    if (const VkResult made = gpuErrors_.create(context, (kGreatestRecordOffset + 1) * 4); made != VK_SUCCESS)
        return made;
    store64(root_.words() + kRootGpuErrors, gpuErrors_.address());
    freeSlots_ = {{0, kSlots}};
    if (!addPages(0) || !growHashTable())
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    kept_.write();
    return VK_SUCCESS;
}

// Shaders rely on neither the root nor a page crossing a multiple of 2^32.
VkResult RootTable::createTable(GpuBuffer &buffer, size_t table, bool known)
{
    const VkDeviceSize bytes = kTableBytes[table];
    const VkResult result = known ? createKnownTable(buffer, table) : buffer.create(context_, bytes);
    if (result != VK_SUCCESS || !crossesWord(buffer.address(), bytes))
        return result;
    // Only one of two buffers that exist at the same time can cross it.
    GpuBuffer other;
    const VkResult again = other.create(context_, bytes);
    if (again == VK_SUCCESS)
        buffer = std::move(other);
    return again != VK_SUCCESS || !crossesWord(buffer.address(), bytes) ? again : VK_ERROR_OUT_OF_DEVICE_MEMORY;
}

VkResult RootTable::createKnownTable(GpuBuffer &buffer, size_t table)
{
    const VkDeviceSize bytes = kTableBytes[table];
    if (fixed_.data() &&
        buffer.createOn(context_, fixed_.data() + kTableOffsets[table], wholePages(bytes)) == VK_SUCCESS)
        return VK_SUCCESS;
    if (kept_.isOpen()) {
        ReplayAddress address = kept_.known(table);
        if (buffer.createAgain(context_, bytes, address) == VK_SUCCESS) {
            // A table that cannot stay there should not be there in the next run either.
            kept_.set(table, crossesWord(buffer.address(), bytes) ? ReplayAddress{} : address);
            return VK_SUCCESS;
        }
    }
    return buffer.create(context_, bytes);
}

bool RootTable::addPages(uint32_t lastPage)
{
    if (pageCount_ > lastPage)
        return true;
    for (; pageCount_ <= lastPage; ++pageCount_) {
        GpuBuffer buffer;
        if (createTable(buffer, kFirstPages, pages_.empty()) != VK_SUCCESS)
            return false;
        const VkDeviceAddress address = pages_.emplace_back(std::move(buffer)).address();
        if (pageCount_ == 0)
            firstSlots_ = address;
        fenceBeforePublishing();
        setPage(pageCount_, address); // last: what shaders can reach is never freed
    }
    // A shader that reads the custom index without a hit reads any slot, so every page has to be readable.
    for (uint32_t page = pageCount_; page < kDirectoryPages; ++page)
        setPage(page, firstSlots_);
    return true;
}

// Stores the address that the record of slot 0 would have if the page continued to it, except that the upper word stays
// that of the page. So shaders add the slot itself, and not the rest of the slot.
void RootTable::setPage(uint32_t page, VkDeviceAddress address)
{
    const auto low = static_cast<uint32_t>(address) - static_cast<uint32_t>(page * kPageBytes);
    store64(root_.words() + kRootHeaderWords + size_t{page} * 2, (address >> 32 << 32) | low);
}

std::shared_ptr<SlotRange> RootTable::allocateSlots(uint32_t count)
{
    return orNothing([&]() -> std::shared_ptr<SlotRange> {
        std::lock_guard lock(mutex_);
        for (auto it = freeSlots_.begin(); it != freeSlots_.end(); ++it) {
            const auto [first, available] = *it;
            if (available < count)
                continue;
            const uint32_t lastPage = (first + std::max(count, 1u) - 1) >> kSlotsPerPageLog2;
            if (!addPages(lastPage))
                return nullptr;
            std::vector<VkDeviceAddress> pages;
            for (uint32_t page = first >> kSlotsPerPageLog2; page <= lastPage; ++page)
                pages.push_back(pages_[page].address());
            auto slots = std::make_shared<SlotRange>(*this, first, count, std::move(pages)); // nothing fails after this
            auto rest = freeSlots_.extract(it);
            if (available > count) {
                rest.key() = first + count;
                rest.mapped() = available - count;
                freeSlots_.insert(std::move(rest));
            }
            return slots;
        }
        return nullptr;
    });
}

void RootTable::freeSlots(uint32_t first, uint32_t count)
{
    if (count == 0)
        return;
    std::lock_guard lock(mutex_);
    auto after = freeSlots_.lower_bound(first);
    if (after != freeSlots_.end() && first + count == after->first) {
        count += after->second;
        after = freeSlots_.erase(after);
    }
    if (after != freeSlots_.begin()) {
        const auto before = std::prev(after);
        if (before->first + before->second == first) {
            before->second += count;
            return;
        }
    }
    freeSlots_[first] = count;
}

StructureDescriptor RootTable::acquireDescriptor(VkDeviceAddress reference)
{
    std::lock_guard lock(mutex_);
    return orNothing([&] { return acquireDescriptor(reference, structureDescriptors_); });
}

StructureDescriptor RootTable::acquireDescriptor(VkDeviceAddress key, StructureDescriptorPool &pool)
{
    if (const auto it = descriptors_.find(key); it != descriptors_.end()) {
        ++it->second.users;
        return pool.location(it->second.index);
    }
    if ((usedBuckets_ + 1) * 2 > buckets_ && !growHashTable())
        return {};
    const auto entry = descriptors_.emplace(key, Descriptor{StructureDescriptorPool::kNone, 1, &pool, nullptr}).first;
    Undo undo([&] { descriptors_.erase(entry); });
    const uint32_t index = entry->second.index = pool.acquire(context_);
    if (index == StructureDescriptorPool::kNone)
        return {};
    undo.keep();
    insertBucket(key, pool.location(index).address);
    return pool.location(index);
}

VkDeviceAddress RootTable::acquireMicromap(VkDeviceAddress address, VkDeviceSize bytes)
{
    const VkDeviceAddress key = address + kMicromapKey;
    std::lock_guard lock(mutex_);
    if (!orNothing([&] { return acquireDescriptor(key, micromapDescriptors_); }).address)
        return 0;
    uint32_t *words = micromapDescriptors_.words(descriptors_.at(key).index);
    words[2] = kDescriptorMicromap;
    // Micromaps may share memory: the capacity is that of the largest.
    words[3] = std::max(words[3], static_cast<uint32_t>(std::min<VkDeviceSize>(bytes / kDataUnitBytes, UINT32_MAX)));
    return key;
}

void RootTable::releaseDescriptor(VkDeviceAddress key)
{
    std::lock_guard lock(mutex_);
    const auto it = descriptors_.find(key);
    if (it == descriptors_.end() || --it->second.users > 0)
        return;
    removeBucket(key);
    if (!it->second.keys || --*it->second.keys == 0)
        it->second.pool->release(it->second.index);
    descriptors_.erase(it);
}

bool RootTable::addReference(VkDeviceAddress reference, VkDeviceAddress known)
{
    std::lock_guard lock(mutex_);
    return orNothing([&] { return addKey(reference, known); });
}

VkDeviceAddress RootTable::holdDescriptor(VkDeviceAddress known)
{
    std::lock_guard lock(mutex_);
    const VkDeviceAddress key = ++heldKeys_ * 4 + kHeldKey; // not the address of any structure
    return orNothing([&] { return addKey(key, known); }) ? key : 0;
}

bool RootTable::addKey(VkDeviceAddress reference, VkDeviceAddress known)
{
    const auto leads = descriptors_.find(known);
    if (leads == descriptors_.end())
        return false;
    if (const auto it = descriptors_.find(reference); it != descriptors_.end()) {
        const bool same = it->second.pool == leads->second.pool && it->second.index == leads->second.index;
        it->second.users += same ? 1 : 0;
        return same;
    }
    if ((usedBuckets_ + 1) * 2 > buckets_ && !growHashTable())
        return false;
    Descriptor &descriptor = leads->second;
    if (!descriptor.keys)
        descriptor.keys = std::make_shared<uint32_t>(1);
    descriptors_.emplace(reference, Descriptor{descriptor.index, 1, descriptor.pool, descriptor.keys});
    ++*descriptor.keys;
    insertBucket(reference, descriptor.pool->location(descriptor.index).address);
    return true;
}

uint32_t RootTable::greatestRecordOffset() const
{
    return __atomic_load_n(gpuErrors_.words() + kGreatestRecordOffset, __ATOMIC_ACQUIRE);
}

uint32_t RootTable::takeGpuErrors()
{
    const uint32_t *counters = gpuErrors_.words();
    if (__atomic_load_n(counters + kGpuErrorTotal, __ATOMIC_ACQUIRE) ==
        __atomic_load_n(seenGpuErrors_ + kGpuErrorTotal, __ATOMIC_RELAXED))
        return 0;
    std::lock_guard lock(mutex_);
    __atomic_store_n(seenGpuErrors_ + kGpuErrorTotal, __atomic_load_n(counters + kGpuErrorTotal, __ATOMIC_ACQUIRE),
                     __ATOMIC_RELAXED);
    uint32_t bits = 0;
    for (uint32_t i = 0; i < kGpuErrors; ++i) {
        const uint32_t counter = __atomic_load_n(counters + i, __ATOMIC_ACQUIRE);
        if (counter != seenGpuErrors_[i])
            bits |= 1u << i;
        seenGpuErrors_[i] = counter;
    }
    return bits;
}

void RootTable::insertBucket(VkDeviceAddress reference, VkDeviceAddress descriptor)
{
    const GpuBuffer &table = hashTables_.back();
    uint32_t bucket =
        hashReference(static_cast<uint32_t>(reference), static_cast<uint32_t>(reference >> 32)) & (buckets_ - 1);
    while (load64(bucketWords(table, bucket)) != 0 && load64(bucketWords(table, bucket)) != kDeletedKey)
        bucket = (bucket + 1) & (buckets_ - 1);
    if (load64(bucketWords(table, bucket)) == 0)
        ++usedBuckets_;
    store64(bucketWords(table, bucket) + 2, descriptor);
    fenceBeforePublishing();
    store64(bucketWords(table, bucket), reference);
}

// A deleted bucket may be in the middle of another key's probe sequence. If the next bucket is empty no sequence
// continues behind it, and this bucket and the deleted ones before it become empty again. So deleted buckets do not
// accumulate.
void RootTable::removeBucket(VkDeviceAddress reference)
{
    const GpuBuffer &table = hashTables_.back();
    const uint32_t mask = buckets_ - 1;
    uint32_t bucket = hashReference(static_cast<uint32_t>(reference), static_cast<uint32_t>(reference >> 32)) & mask;
    while (load64(bucketWords(table, bucket)) != reference)
        bucket = (bucket + 1) & mask;
    store64(bucketWords(table, bucket), kDeletedKey);
    if (load64(bucketWords(table, (bucket + 1) & mask)) != 0)
        return;
    while (load64(bucketWords(table, bucket)) == kDeletedKey) {
        store64(bucketWords(table, bucket), 0);
        --usedBuckets_;
        bucket = (bucket - 1) & mask;
    }
}

// Creates a table with a capacity of twice the live entries. It may be as large as the old one, since deleted entries
// are dropped.
bool RootTable::growHashTable()
{
    uint32_t buckets = kFirstBuckets;
    while (buckets < (descriptors_.size() + 1) * 4)
        buckets *= 2;
    GpuBuffer table;
    if (table.create(context_, VkDeviceSize{buckets} * kHashBucketWords * 4) != VK_SUCCESS ||
        (table.address() & kBucketsLog2Mask) != 0)
        return false;
    hashTables_.push_back(std::move(table)); // nothing fails after this
    buckets_ = buckets;
    usedBuckets_ = 0;
    for (const auto &[reference, descriptor] : descriptors_)
        insertBucket(reference, descriptor.pool->location(descriptor.index).address);
    fenceBeforePublishing();
    store64(root_.words() + kRootHashTable,
            hashTables_.back().address() | static_cast<uint32_t>(std::countr_zero(buckets)));
    return true;
}

} // namespace vellum::layer
