// SPDX-License-Identifier: Apache-2.0
// The state subsystem: the layer's records of micromaps and acceleration structures, the tables that lead a shader from
// a hit to its micromap, and names and private data of layer objects.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "layer/memory/device_buffers.h"
#include "layer/rules/rule.h"
#include "layer/state/acceleration_structure.h"
#include "layer/state/layer_objects.h"
#include "layer/state/micromap_warnings.h"
#include "layer/state/root_table.h"

namespace vellum::layer
{

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

} // namespace vellum::layer
