// SPDX-License-Identifier: Apache-2.0
// A bottom-level structure of one triangle as the driver serializes it. It is made by a probe of the driver when it is
// needed first.
#pragma once

#include <mutex>

#include <vulkan/vulkan.h>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceStructures;

// Serialized data, beginning with the driver's UUIDs. The driver gets it in place of data that it must not see.
struct FallbackStructure {
    std::mutex mutex;    // held while it is made: every user needs the result
    bool probed = false; // the probe was carried out, with whatever result
    GpuBuffer memory;
    uint32_t units = 0;              // of 16 bytes; 0: the driver could not serialize it
    VkDeviceSize structureBytes = 0; // of the structure that it is deserialized to
    // The driver serializes and deserializes as many bytes as the structure was created with.
    bool wholeCopies = false;
};

// A snapshot of what is known of the fallback: a repeated probe may add to it.
struct FallbackFacts {
    VkDeviceAddress address = 0;     // of its bytes, which the host sees as `words`; 0 without a fallback
    const uint32_t *words = nullptr; // lives as long as the device
    uint32_t units = 0;
    VkDeviceSize structureBytes = 0;
    bool wholeCopies = false;
};

// Returns no fallback if the application did not enable acceleration structures, or has no queue that can build them.
FallbackFacts fallbackStructure(DeviceStructures &device);

} // namespace vellum::layer
