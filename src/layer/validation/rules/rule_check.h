// SPDX-License-Identifier: Apache-2.0
// The rules of one object or element of a command, when it is recorded and when it is executed.
#pragma once

#include <functional>
#include <string>

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

} // namespace vellum::layer
