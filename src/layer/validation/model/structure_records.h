// SPDX-License-Identifier: Apache-2.0
// The content of structures, for checks that the device makes: a record for each in host-visible memory
// (core/findings.h). Builds and copies write records in the order in which the device executes them.
#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/findings.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceTable;

using RecordWords = std::array<uint32_t, shared::kStructureRecordWords>;

class StructureRecords
{
public:
    // A record that its destructor releases. Must not outlive the records.
    class Owner
    {
    public:
        Owner(StructureRecords &records, uint32_t index) : records_(records), index_(index) {}
        ~Owner() { records_.giveBack(index_); }
        Owner(const Owner &) = delete;
        Owner &operator=(const Owner &) = delete;
        [[nodiscard]] uint32_t index() const { return index_; }

    private:
        StructureRecords &records_;
        uint32_t index_;
    };

    VkResult create(const GpuContext &context);
    // The record of a new structure; null if the check is off or there are too many structures.
    std::shared_ptr<Owner> take();
    // States that instances name a structure by that address.
    void setReference(VkDeviceAddress reference, const Owner &record);
    // The structure is destroyed. Until another one gets its address, shaders find that it was destroyed; the oldest of
    // many addresses are forgotten.
    void setDestroyed(const Owner &record);
    void removeReference(const Owner &record);
    // Some structures may have references that the table lacks.
    void setIncomplete();

    [[nodiscard]] VkDeviceAddress address() const { return records_.address(); }
    // The address of a record; for null that of record 0, which states nothing.
    [[nodiscard]] VkDeviceAddress addressOf(const Owner *record) const
    {
        return address() + (record ? record->index() : 0) * sizeof(RecordWords);
    }
    [[nodiscard]] VkDeviceAddress references() const { return references_.address(); }

    // Records the writing of a record, which the commands must order.
    void set(const DeviceTable &next, VkCommandBuffer commandBuffer, const Owner &record,
             const RecordWords &words) const;
    void copy(const DeviceTable &next, VkCommandBuffer commandBuffer, const Owner *from, const Owner &to) const;
    // These two write at once, for commands of the host.
    void set(const Owner &record, const RecordWords &words);
    void copy(const Owner *from, const Owner &to);

private:
    void giveBack(uint32_t index);
    void removeReference(uint32_t index);
    [[nodiscard]] uint32_t *bucket(uint32_t number);
    [[nodiscard]] uint32_t *bucketOf(VkDeviceAddress reference, bool make);
    void remove(uint32_t *words);

    static constexpr uint32_t kDestroyed = 1;

    GpuBuffer records_;
    GpuBuffer references_;
    std::mutex mutex_; // guards what is below, and the host's writes to the buffers
    std::vector<uint32_t> free_;
    // Records that were in use at any time. Record 0 belongs to no structure, and kDestroyed is that of destroyed
    // structures.
    uint32_t used_ = kDestroyed + 1;
    std::deque<VkDeviceAddress> destroyed_;           // references of destroyed structures
    uint32_t buckets_ = 0;                            // in use
    std::map<uint32_t, VkDeviceAddress> referenceOf_; // of records
    std::map<VkDeviceAddress, uint32_t> owners_;      // the number of records that have a reference
};

} // namespace vellum::layer
