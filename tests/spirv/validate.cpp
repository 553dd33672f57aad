#include "validate.h"

namespace vellum::test
{

spv_target_env environmentOf(const Module &words)
{
    return words.size() > 1 && words[1] >= 0x10600 ? SPV_ENV_VULKAN_1_3 : SPV_ENV_VULKAN_1_2;
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
