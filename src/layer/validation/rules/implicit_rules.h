// SPDX-License-Identifier: Apache-2.0
// The rules that the registry states for all commands and structures ("Valid Usage (Implicit)"), for those of micromaps
// and of VK_KHR_device_address_commands.
#pragma once

#include <string_view>

#include "layer/rules/rule.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

// The queues that a command needs one of. 0: the command is not checked.
constexpr VkQueueFlags queuesOf(std::string_view command)
{
    constexpr VkQueueFlags kAll = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT | VK_QUEUE_TRANSFER_BIT;
    constexpr std::pair<std::string_view, VkQueueFlags> kCommands[] = {
        {"vkCmdBuildMicromapsEXT", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyMicromapEXT", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyMicromapToMemoryEXT", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyMemoryToMicromapEXT", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdWriteMicromapsPropertiesEXT", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdBuildAccelerationStructuresKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyAccelerationStructureKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyAccelerationStructureToMemoryKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyMemoryToAccelerationStructureKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdWriteAccelerationStructuresPropertiesKHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdDispatchIndirect2KHR", VK_QUEUE_COMPUTE_BIT},
        {"vkCmdCopyQueryPoolResultsToMemoryKHR", kAll},
        {"vkCmdCopyMemoryKHR", kAll},
        {"vkCmdUpdateMemoryKHR", kAll},
        {"vkCmdFillMemoryKHR", kAll},
        {"vkCmdCopyMemoryToImageKHR", kAll},
        {"vkCmdCopyImageToMemoryKHR", kAll},
    };
    for (const auto &[name, queues] : kCommands) {
        if (name == command)
            return queues;
    }
    return 0;
}
// The state of the command buffer, for a command that is recorded outside of render passes.
void checkCommand(DeviceModel &device, VkCommandBuffer commandBuffer, const char *command, VkQueueFlags queues);

// The feature micromap of VK_EXT_opacity_micromap, which a command needs. `vuid`: of the command.
void checkFeature(const InputCheck &check, const char *vuid);

// A count that is not 0. `vuid`: of the command.
void checkCount(DeviceModel &device, const char *command, const char *member, uint32_t count, const char *vuid);

// The sType of a structure, which has no other structures in its chain.
struct StructureIds {
    VkStructureType type;
    const char *sType;
    const char *pNext;
};
inline constexpr StructureIds kMicromapCreateInfo{VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT,
                                                  "VUID-VkMicromapCreateInfoEXT-sType-sType",
                                                  "VUID-VkMicromapCreateInfoEXT-pNext-pNext"};
template <typename Info>
void checkStructure(const InputCheck &check, const Info &info, const StructureIds &ids)
{
    if (info.sType != ids.type)
        check.report(ids.sType, "sType", "it is that of " + nameOf(info.sType) + ", not of " + nameOf(ids.type));
    if (info.pNext)
        check.report(ids.pNext, "pNext", "it is not null; nothing extends this structure");
}

} // namespace vellum::layer
