// SPDX-License-Identifier: Apache-2.0
#include "validate.h"

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

} // namespace vellum::test
