// SPDX-License-Identifier: Apache-2.0
// Checks of the input of a command, and the policy for violations. Input is rejected, with an error, if it would damage
// memory, read wild addresses or has no meaning. Input that does no harm is tolerated, with a warning: the layer goes
// on, as drivers do. With the setting `strict` it is rejected as well. docs/messages.md lists the messages.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <vulkan/vulkan.h>

#include "layer/base/report.h"

namespace vellum::layer
{

class CommandCheck
{
public:
    // `element`: index in pInfos. `object`: the object that messages are about, or 0.
    CommandCheck(Reporter &report, const char *command, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN, uint64_t object = 0,
               std::optional<uint32_t> element = std::nullopt)
        : report_(report), command_(command), type_(type), object_(object), element_(element)
    {
    }

    // Reports an error. Returns false, so that callers can write return reject(...).
    bool reject(const char *id, const std::string &text) const
    {
        report_.error(id, where() + text, type_, object_);
        return false;
    }
    // Reports a fault that does no harm. Returns whether the command may be carried out.
    [[nodiscard]] bool tolerate(const char *id, const std::string &text) const
    {
        return report_.tolerates(id, where() + text, type_, object_);
    }

    // Tolerates or rejects input that does harm only under some conditions.
    [[nodiscard]] bool tolerateIf(bool harmless, const char *id, const std::string &text) const
    {
        return harmless ? tolerate(id, text) : reject(id, text);
    }
    // Checks the address of serialized data, which by the specification is a multiple of `alignment`. The layer's
    // shaders read and write 16 bytes at once, so other multiples of 16 do no harm.
    [[nodiscard]] bool checkSerializedAddress(VkDeviceAddress address, uint32_t alignment, const char *nullId,
                                              const char *alignmentId) const
    {
        if (address == 0)
            return reject(nullId, "the serialized data has a null address");
        if (address % alignment == 0)
            return true;
        return tolerateIf(address % 16 == 0, alignmentId,
                          "the address of the serialized data is not a multiple of " + std::to_string(alignment));
    }

private:
    [[nodiscard]] std::string where() const
    {
        std::string text = std::string(command_) + ": ";
        if (element_)
            text += "pInfos[" + std::to_string(*element_) + "]: ";
        return text;
    }

    Reporter &report_;
    const char *command_;
    VkObjectType type_;
    uint64_t object_;
    std::optional<uint32_t> element_;
};

} // namespace vellum::layer
