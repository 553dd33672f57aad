// SPDX-License-Identifier: Apache-2.0
// The rules of one object or element of a command, when it is recorded and when it is executed.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "layer/rules/rule.h"
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{

class RuleCheck : public InputCheck
{
public:
    // `commandBuffer`: null for host commands.
    RuleCheck(DeviceModel &device, const Place &place, ObjectHandle object = {},
              VkCommandBuffer commandBuffer = VK_NULL_HANDLE)
        : InputCheck(device.at(place, object)), model_(device), commandBuffer_(commandBuffer)
    {
    }

    [[nodiscard]] DeviceModel &model() const { return model_; }
    // The check of a part, whose place must outlive it.
    [[nodiscard]] RuleCheck at(const Place &place) const { return {model_, place, object(), commandBuffer_}; }
    [[nodiscard]] VkCommandBuffer commandBuffer() const { return commandBuffer_; } // null for host commands

    // Checks a rule when the command is executed. `find` returns what is wrong then, or an empty text.
    void whenExecuted(const char *vuid, std::function<std::string()> find) const;
    // As above, for several rules.
    void whenExecuted(std::function<void()> check) const;
    // An effect of the command. `isOrdered`: what objects hold then is known.
    void afterExecution(std::function<void(bool isOrdered)> effect) const;

private:
    DeviceModel &model_;
    VkCommandBuffer commandBuffer_;
};

// The first `bytes` bytes of a structure, at most its size.
MemoryRange memoryOf(const ValidatedStructure *structure, VkDeviceSize bytes);
// Buffers may alias each other in memory. Of unknown memory, the range is that of the addresses. `known`: the buffer at
// the address, if it was looked up.
MemoryRange memoryAt(const DeviceModel &device, VkDeviceAddress address, VkDeviceSize bytes,
                     VkBuffer known = VK_NULL_HANDLE);

// --- Rules that several commands have ---

// Some buffer still has the address when the command buffer is executed.
void checkWhenExecuted(DeviceModel &device, VkCommandBuffer commandBuffer, const AccessedAddress &accessed);

// The micromap or structure is constructed when the command is executed.
void checkConstructed(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &structure, const char *vuid);
// It was built with a flag that allows compaction, where its flags are known.
void checkCompactable(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &structure, const char *vuid);

// --- Rules that the registry states for all commands and structures ("Valid Usage (Implicit)"), for those of micromaps
// and of VK_KHR_device_address_commands ---

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
