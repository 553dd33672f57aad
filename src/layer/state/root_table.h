// SPDX-License-Identifier: Apache-2.0
// The tables that lead a rewritten shader from a hit to its micromap, and a TLAS build from a reference to its BLAS.
// Layouts: core/records.h.
//
// Nothing that a shader can reach moves or is freed before the device is destroyed: the address of the root is a
// constant in rewritten SPIR-V, pages are only added, and an outgrown hash table stays readable.
//
// Host and device never write to the same page of memory (state/structure_descriptor_pool.h explains why): the host
// writes the root and the hash tables; the device writes instance records, descriptors of structures and GPU error
// counters.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/records.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/kept_addresses.h"
#include "layer/state/structure_descriptor_pool.h"

namespace vellum::layer
{

class RootTable;

// Consecutive instance slots. The destructor returns them to the table.
class SlotRange
{
public:
    // `pages`: the addresses of the pages that the slots are in.
    SlotRange(RootTable &table, uint32_t first, uint32_t count, std::vector<VkDeviceAddress> pages)
        : table_(table), first_(first), count_(count), pages_(std::move(pages))
    {
    }
    ~SlotRange();
    SlotRange(const SlotRange &) = delete;
    SlotRange &operator=(const SlotRange &) = delete;
    [[nodiscard]] uint32_t first() const { return first_; }
    [[nodiscard]] uint32_t count() const { return count_; }
    // The address of the instance record of one of the slots. The records of its page follow it.
    [[nodiscard]] VkDeviceAddress recordAddress(uint32_t slot) const;
    // Command buffers that use the slots keep this. It does not keep the slots.
    [[nodiscard]] const std::shared_ptr<const void> &use() const { return use_; }
    [[nodiscard]] bool isUsed() const { return use_.use_count() > 1; }

private:
    RootTable &table_;
    uint32_t first_;
    uint32_t count_;
    std::vector<VkDeviceAddress> pages_;
    std::shared_ptr<const void> use_ = std::make_shared<char>();
};

class RootTable
{
public:
    // `keptAddresses`: the beginning of the paths of files with earlier addresses of the tables
    // (memory/kept_addresses.h); empty: addresses are not kept.
    VkResult create(const GpuContext &context, const std::string &keptAddresses = {});
    [[nodiscard]] VkDeviceAddress address() const { return root_.address(); }
    // The address of the instance records of the first kFirstSlots slots.
    [[nodiscard]] VkDeviceAddress firstSlots() const { return firstSlots_; }

    // Null if the 2^24 slots or memory are used up.
    std::shared_ptr<SlotRange> allocateSlots(uint32_t count);

    // The descriptor of the acceleration structure with this reference, which the first call creates. Each call is
    // paired with a releaseDescriptor: acceleration structures that alias each other have the same reference and
    // descriptor. Its address is 0 if there is no memory.
    StructureDescriptor acquireDescriptor(VkDeviceAddress reference);
    void releaseDescriptor(VkDeviceAddress reference);
    // Adds a reference that leads to the descriptor of a known one; paired with a releaseDescriptor. Returns false if
    // it leads to another descriptor already, or memory runs out.
    bool addReference(VkDeviceAddress reference, VkDeviceAddress known);
    // Adds a synthetic key, which is not an address, to the descriptor of a known reference; paired with a
    // releaseDescriptor. 0 if there is no memory.
    VkDeviceAddress holdDescriptor(VkDeviceAddress known);
    // Adds a micromap of that size at an address. Returns the key by which its descriptor is released, or 0 if there is
    // no memory.
    VkDeviceAddress acquireMicromap(VkDeviceAddress address, VkDeviceSize bytes);

    // Returns whether shaders count errors: only after create.
    [[nodiscard]] bool countsGpuErrors() const { return gpuErrors_.words() != nullptr; }
    // The errors that shaders have found since the last call, one bit for each kGpuError*. The host only reads their
    // counters (see StructureDescriptorPool).
    uint32_t takeGpuErrors();
    [[nodiscard]] VkDeviceAddress gpuErrorsAddress() const { return gpuErrors_.address(); }

    // The greatest instanceShaderBindingTableRecordOffset of the builds that the device has executed, and the address
    // at which shaders read and update it.
    [[nodiscard]] uint32_t greatestRecordOffset() const;
    [[nodiscard]] VkDeviceAddress greatestRecordOffsetAddress() const
    {
        return gpuErrors_.address() + shared::kGreatestRecordOffset * 4;
    }

private:
    friend class SlotRange;
    struct Descriptor {
        uint32_t index = 0;
        uint32_t users = 0;
        StructureDescriptorPool *pool = nullptr;
        std::shared_ptr<uint32_t> keys; // number of keys that lead to the descriptor; null: one
    };
    StructureDescriptor acquireDescriptor(VkDeviceAddress key, StructureDescriptorPool &pool);
    bool addKey(VkDeviceAddress key, VkDeviceAddress known);
    void freeSlots(uint32_t first, uint32_t count);
    bool addPages(uint32_t lastPage);
    void setPage(uint32_t page, VkDeviceAddress address);
    bool growHashTable();
    void insertBucket(VkDeviceAddress reference, VkDeviceAddress descriptor);
    void removeBucket(VkDeviceAddress reference);

    VkResult createTable(GpuBuffer &buffer, size_t table, bool known);
    // Creates a table whose address rewritten shaders contain: at the same address in every run, if possible.
    VkResult createKnownTable(GpuBuffer &buffer, size_t table);

    GpuContext context_;
    FixedMemory fixed_; // outlives the buffers on it
    KeptAddresses kept_;
    std::mutex mutex_;
    GpuBuffer root_, gpuErrors_;
    uint32_t seenGpuErrors_[shared::kGpuErrorCounters] = {};
    std::vector<GpuBuffer> pages_;   // guarded by mutex_, like all members below
    VkDeviceAddress firstSlots_ = 0; // address of the first page; set by create(), and read without the mutex
    uint32_t pageCount_ = 0;
    std::map<uint32_t, uint32_t> freeSlots_; // first -> count, never adjacent

    std::vector<GpuBuffer> hashTables_; // the last one is in use
    uint32_t buckets_ = 0;
    uint32_t usedBuckets_ = 0;     // including deleted ones
    VkDeviceAddress heldKeys_ = 0; // number of synthetic keys ever allocated
    std::unordered_map<VkDeviceAddress, Descriptor> descriptors_;
    StructureDescriptorPool structureDescriptors_{StructureDescriptorPool::Writer::Device};
    StructureDescriptorPool micromapDescriptors_{StructureDescriptorPool::Writer::Host};
};

} // namespace vellum::layer
