// The tables that lead a rewritten shader from a hit to its micromap, and a TLAS build from a reference to its BLAS.
// Layouts: core/records.h.
//
// Nothing that a shader can reach ever moves or is freed before the device: the root's address is a constant in
// rewritten SPIR-V, pages are only added, and a hash table that has been outgrown stays readable.
//
// And no page of memory is written by host and device in turn (state/structure_descriptor_pool.h tells why): the root
// and the hash tables are the host's, instance records, descriptors of structures and counters of notices the device's.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/records.h"
#include "layer/memory/fixed_memory.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/kept_addresses.h"
#include "layer/state/structure_descriptor_pool.h"

namespace vellum::layer
{

class RootTable;

// Consecutive instance slots. They return to the table when the last owner lets go.
class SlotRange
{
public:
    SlotRange(RootTable &table, uint32_t first, uint32_t count) : table_(table), first_(first), count_(count) {}
    ~SlotRange();
    SlotRange(const SlotRange &) = delete;
    SlotRange &operator=(const SlotRange &) = delete;
    [[nodiscard]] uint32_t first() const { return first_; }
    [[nodiscard]] uint32_t count() const { return count_; }

private:
    RootTable &table_;
    uint32_t first_;
    uint32_t count_;
};

class RootTable
{
public:
    // `keptAddresses`: begin of the path of files that say where the tables lay before (memory/kept_addresses.h);
    // empty: there are none.
    VkResult create(const GpuContext &context, const std::string &keptAddresses = {});
    [[nodiscard]] VkDeviceAddress address() const { return root_.address(); }
    // Of the instance records of the first kFirstSlots slots.
    [[nodiscard]] VkDeviceAddress firstSlots() const { return firstSlots_; }

    // Null where the 2^24 slots, or memory, are used up.
    std::shared_ptr<SlotRange> allocateSlots(uint32_t count);

    // The descriptor of the acceleration structure with this reference; made when it is asked for first. Every call is
    // paired with a releaseDescriptor: acceleration structures that alias have the same reference, and share the
    // descriptor. Its address is 0 where there is no memory.
    StructureDescriptor acquireDescriptor(VkDeviceAddress reference);
    void releaseDescriptor(VkDeviceAddress reference);
    // Another reference that leads to the descriptor of a known one; paired with a releaseDescriptor. False where it
    // leads to another descriptor already, or there is no memory.
    bool addReference(VkDeviceAddress reference, VkDeviceAddress known);
    // Another user of the descriptor of a known reference, under a key that is no address; paired with a
    // releaseDescriptor. 0 where there is no memory.
    VkDeviceAddress holdDescriptor(VkDeviceAddress known);
    // Says that there is a micromap of so many bytes at an address; returns the key to release its descriptor by, 0
    // where there is no memory.
    VkDeviceAddress acquireMicromap(VkDeviceAddress address, VkDeviceSize bytes);

    // What shaders had to tell since the last call: bits kNotice*. The host only reads their counters, see
    // StructureDescriptorPool.
    uint32_t takeGpuErrors();

    // The greatest instanceShaderBindingTableRecordOffset of the builds that the device has carried out so far, and
    // where shaders find that of all builds before them.
    [[nodiscard]] uint32_t greatestRecordOffset() const;
    [[nodiscard]] VkDeviceAddress greatestRecordOffsetAddress() const
    {
        return gpuErrors_.address() + shared::kGreatestRecordOffset * 4;
    }

private:
    friend class SlotRange;
    struct Cell {
        uint32_t index = 0;
        uint32_t users = 0;
        StructureDescriptorPool *pool = nullptr;
        std::shared_ptr<uint32_t> keys; // that lead to this descriptor; null: there is only one
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
    // Tables that rewritten shaders have the address of: at the same address in every run, where that can be had.
    VkResult createKnownTable(GpuBuffer &buffer, size_t table);

    GpuContext context_;
    FixedMemory fixed_; // outlives the buffers on it
    KeptAddresses kept_;
    std::mutex mutex_;
    GpuBuffer root_, gpuErrors_;
    uint32_t seenGpuErrors_[shared::kGpuErrorCounters] = {};
    std::vector<GpuBuffer> pages_;   // guarded by mutex_, as all below
    VkDeviceAddress firstSlots_ = 0; // of the first page; set by create(), and read without the mutex
    uint32_t pageCount_ = 0;
    std::map<uint32_t, uint32_t> freeSlots_; // first -> count, never adjacent

    std::vector<GpuBuffer> hashTables_; // the last one is in use
    uint32_t buckets_ = 0;
    uint32_t usedBuckets_ = 0;     // with deleted ones
    VkDeviceAddress heldKeys_ = 0; // that there were
    std::unordered_map<VkDeviceAddress, Cell> descriptors_;
    StructureDescriptorPool structureDescriptors_; // written by the device
    StructureDescriptorPool micromapDescriptors_;  // written by the host
};

} // namespace vellum::layer
