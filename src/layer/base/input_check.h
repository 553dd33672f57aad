// What is wrong with one command or object, or with one element of a command. What would damage memory, read wild
// addresses or has no meaning is refused. What does no harm is told, and the layer goes on, as drivers do; with the
// setting `strict` it is refused as well. docs/messages.md lists both.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <vulkan/vulkan.h>

#include "layer/base/report.h"

namespace vellum::layer
{

class InputCheck
{
public:
    // `element`: of pInfos. The object is the one that messages are about; 0: none.
    InputCheck(Reporter &report, const char *command, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN, uint64_t object = 0,
               std::optional<uint32_t> element = std::nullopt)
        : report_(report), command_(command), type_(type), object_(object), element_(element)
    {
    }

    // Tells what forbids it. Always false: it may not be carried out.
    bool reject(const char *id, const std::string &text) const
    {
        report_.error(id, where() + text, type_, object_);
        return false;
    }
    // Tells what does no harm. Whether it may be carried out.
    [[nodiscard]] bool tolerate(const char *id, const std::string &text) const
    {
        return report_.tolerates(id, where() + text, type_, object_);
    }

    // Tolerates or refuses what does harm only sometimes.
    [[nodiscard]] bool tolerateIf(bool harmless, const char *id, const std::string &text) const
    {
        return harmless ? tolerate(id, text) : reject(id, text);
    }
    // Serialized data at an address that the specification wants to be a multiple of `alignment`. Shaders of the layer
    // read and write 16 bytes at once.
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
