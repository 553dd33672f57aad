// A bottom-level structure of one triangle as the driver serializes it, made when it is needed first: how the driver
// serializes can only be found out by trying.
#pragma once

#include <mutex>

#include <vulkan/vulkan.h>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceStructures;

// It begins with the driver's UUIDs, and stands in for serialized data that the driver must not see.
struct FallbackStructure {
    std::mutex mutex;   // held while it is made: nobody who asks can go on before
    bool tried = false; // the driver was tried out, whatever came of it
    GpuBuffer memory;
    uint32_t units = 0;              // of 16 bytes; 0: there is none
    VkDeviceSize structureBytes = 0; // of the structure that it is deserialized to
    // The driver serializes and deserializes as many bytes as the structure was created with.
    bool wholeCopies = false;
};

// What is known of it, as it was when somebody asked: a trial that is repeated may add to it.
struct FallbackFacts {
    VkDeviceAddress address = 0;     // of its bytes, which the host sees as `words`; only where there is one
    const uint32_t *words = nullptr; // lives as long as the device
    uint32_t units = 0;
    VkDeviceSize structureBytes = 0;
    bool wholeCopies = false;
};

// There is none where the application did not enable acceleration structures, or has no queue that can build them.
FallbackFacts fallbackStructure(DeviceStructures &device);

} // namespace vellum::layer
