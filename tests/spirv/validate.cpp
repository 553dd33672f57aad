// SPDX-License-Identifier: Apache-2.0
#include "validate.h"

#include <cstring>

namespace vellum::test
{

spv_target_env environmentOf(const Module &words)
{
    const uint32_t version = words.size() > 1 ? words[1] : 0;
    if (version >= 0x10600)
        return SPV_ENV_VULKAN_1_3;
    if (version >= 0x10500)
        return SPV_ENV_VULKAN_1_2;
    return version >= 0x10400 ? SPV_ENV_VULKAN_1_1_SPIRV_1_4 : SPV_ENV_VULKAN_1_1;
}

std::string validate(const Module &words)
{
    spvtools::SpirvTools tools(environmentOf(words));
    std::string messages;
    tools.SetMessageConsumer([&](spv_message_level_t, const char *, const spv_position_t &, const char *message) {
        messages += std::string(message) + "\n";
    });
    spvtools::ValidatorOptions options;
    options.SetScalarBlockLayout(true);
    if (tools.Validate(words.data(), words.size(), options))
        return "";
    return messages.empty() ? "invalid" : messages;
}

Module withKnownMode(Module words)
{
    constexpr uint32_t kOpExtension = 10, kOpCapability = 17, kOpExecutionMode = 16, kOpExecutionModeId = 331;
    constexpr uint32_t kCapability = 6032, kMode = 6031, kOtherCapability = 4464, kOtherMode = 4459, kOtherOperand = 32;
    for (size_t at = 5; at < words.size() && words[at] >> 16 != 0; at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffff;
        if (opcode == kOpCapability && words[at + 1] == kCapability)
            words[at + 1] = kOtherCapability;
        if (opcode == kOpExtension &&
            std::strcmp(reinterpret_cast<const char *>(&words[at + 1]), "SPV_KHR_opacity_micromap") == 0)
            std::memcpy(&words[at + 2], "EXT_", 4);
        if (opcode == kOpExecutionModeId && words[at + 2] == kMode) {
            words[at] = 4u << 16 | kOpExecutionMode;
            words[at + 2] = kOtherMode;
            words[at + 3] = kOtherOperand;
        }
    }
    return words;
}

} // namespace vellum::test
