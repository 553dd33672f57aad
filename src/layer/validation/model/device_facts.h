// SPDX-License-Identifier: Apache-2.0
// The facts about a device that rules use: the features that the application enabled on it, and its limits.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Driver;

struct DeviceFacts {
    // Enabled features, beyond those in EnabledFeatures.
    bool nullDescriptor = false;
    bool indexTypeUint8 = false;
    bool drawIndirectCount = false;
    bool synchronization2 = false;
    bool maintenance9 = false; // buffers need no ownership transfers
    bool maintenance11 = false;
    bool addressCommands = false; // of VK_KHR_device_address_commands
    bool structureCaptureReplay = false;
    bool addressMultiDevice = false;

    // The host may learn that work is complete by presentation, or by fences and semaphores of others.
    bool waitsElsewhere = false;
    bool isGroup = false;                 // of several physical devices
    VkShaderStageFlags storingStages = 0; // stages whose shaders may write to memory

    bool protectedNoFault = false;
    uint32_t maxVertexInputBindings = 0;
    uint32_t maxVertexInputBindingStride = 0;
    VkDeviceSize maxTransformFeedbackBufferSize = VK_WHOLE_SIZE;
    std::vector<VkQueueFlags> queueFamilies; // of the physical device
};

DeviceFacts factsOf(const Driver &driver, const VkDeviceCreateInfo &info);

} // namespace vellum::layer
