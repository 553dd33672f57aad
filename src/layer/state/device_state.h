// SPDX-License-Identifier: Apache-2.0
// The state subsystem: the layer's records of micromaps and acceleration structures, the tables that lead a shader from
// a hit to its micromap, and names and private data of layer objects.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/memory/device_buffers.h"
#include "layer/rules/rule.h"
#include "layer/state/acceleration_structure.h"
#include "layer/state/root_table.h"

namespace vellum::layer
{

// VK_EXT_private_data of layer objects, whose handles the driver does not know.
class PrivateData
{
public:
    void set(VkPrivateDataSlot slot, uint64_t object, uint64_t value);
    [[nodiscard]] uint64_t get(VkPrivateDataSlot slot, uint64_t object) const; // 0 if nothing was set
    void forgetObject(uint64_t object);
    void forgetSlot(VkPrivateDataSlot slot);

private:
    mutable std::mutex mutex_;
    std::map<std::pair<uint64_t, VkPrivateDataSlot>, uint64_t> values_;
};

// Warnings of shaders and pipelines that do not declare their use of micromaps. They are wrong only where rays meet
// micromaps, and many programs enable every feature and never build a micromap: a warning is kept until a bottom-level
// structure with micromaps is built on the device.
class MicromapWarnings
{
public:
    explicit MicromapWarnings(const Driver &driver) : driver_(driver) {}

    // Sends the warning, now or when micromaps are used. `id` is a literal.
    void warn(const char *id, const std::string &text);
    // A build of a bottom-level structure with micromaps was recorded.
    void micromapsAreUsed();

private:
    const Driver &driver_;
    std::atomic<bool> used_ = false;
    std::mutex mutex_; // guards the next member, and used_ while it changes
    std::vector<std::pair<const char *, std::string>> kept_;
};

// Raises a maximum that several threads keep.
inline void atomicMax(std::atomic<uint32_t> &greatest, uint32_t value)
{
    uint32_t seen = greatest.load();
    while (seen < value && !greatest.compare_exchange_weak(seen, value)) {
    }
}

struct DeviceState {
    Driver &driver;
    DeviceBuffers &buffers;
    RuleDevice rules{driver, buffers.addresses};
    RootTable root{};
    StructureLocations locations{root};
    std::atomic<uint32_t> deserializations{0};
    std::atomic<uint32_t> mostGeometries{1}; // of all bottom-level builds recorded
    PrivateData privateData{};
    MicromapWarnings warnings{driver};
    std::atomic<bool> validationReportsGpuErrors{false}; // by reportGpuErrors(device, known)
    HandleMap<VkAccelerationStructureKHR, std::shared_ptr<AccelerationStructure>> accelerationStructures{};
    std::mutex unboundMutex{}; // guards the next member
    // GENERIC structures whose buffers have no memory yet, by buffer.
    std::unordered_multimap<VkBuffer, std::weak_ptr<AccelerationStructure>> unboundMicromaps{};

    // Returns whether the layer created the object, so that the driver does not know its handle. Only emulated and
    // translated devices have such objects.
    [[nodiscard]] bool own(VkObjectType type, uint64_t handle) const;
};

// Reports errors that shaders have found in copies since the last call, unless validation does.
void reportGpuErrors(DeviceState &device);
// Reports all except those whose bit is set in `known` (one bit for each kGpuError*).
void reportGpuErrors(DeviceState &device, uint32_t known);

} // namespace vellum::layer
