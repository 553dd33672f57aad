// The room of objects: what the layer keeps of micromaps and acceleration structures, the tables that lead a shader
// from a hit to its micromap, and names and private data of objects that are the layer's own.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "layer/memory/device_buffers.h"
#include "layer/state/acceleration_structure.h"
#include "layer/state/private_data.h"
#include "layer/state/root_table.h"
#include "layer/state/structure_location.h"

namespace vellum::layer
{

struct DeviceState {
    Driver &driver;
    DeviceBuffers &buffers;
    RootTable root{};
    StructureLocations locations{root};
    std::atomic<uint32_t> deserializations{0};
    std::atomic<uint32_t> mostGeometries{1}; // of a bottom-level structure whose build was recorded
    PrivateData privateData{};
    HandleMap<VkAccelerationStructureKHR, std::shared_ptr<AccelerationStructure>> accelerationStructures{};
    std::mutex unnamedMutex{};                                            // guards the next one
    std::vector<std::weak_ptr<AccelerationStructure>> unnamedMicromaps{}; // GENERIC ones, made before their memory

    // Whether a handle of the application's is the layer's own, which means nothing to the driver. Only on emulated
    // and translated devices there are such.
    [[nodiscard]] bool own(VkObjectType type, uint64_t handle) const;
};

} // namespace vellum::layer
