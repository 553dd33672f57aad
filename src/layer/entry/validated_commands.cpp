// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/validated_commands.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "layer/entry/command.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

// The name of a command, as an argument of a template.
struct CommandName {
    char text[64]{};
    template <size_t size>
    consteval CommandName(const char (&name)[size])
    {
        std::copy_n(name, size, text);
    }
};

// A command as Vulkan calls it. It gets the validation of the device.
template <CommandName name, auto function>
struct Validated;

template <CommandName name, typename Result, typename Handle, typename... Arguments,
          Result (*function)(DeviceValidation &, Handle, Arguments...)>
struct Validated<name, function> {
    static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Arguments... arguments) noexcept
    {
        return guarded<Result>([&] {
            const CommandReports reports;
            DeviceValidation &device = *deviceOf(handle).validation;
            constexpr VkQueueFlags kQueues = queuesOf(name.text);
            if constexpr (kQueues != 0)
                checkCommand(device, handle, name.text, kQueues);
            return function(device, handle, arguments...);
        });
    }
};

struct Row {
    const char *command;
    PFN_vkVoidFunction function;
};

#define VELLUM_ROW(name, function)                                                                                     \
    {commandOf("vk" #name), reinterpret_cast<PFN_vkVoidFunction>(&Validated<"vk" #name, validation::function>::call)},
#define VELLUM_NEWER_ROW(name, type, function) VELLUM_ROW(name, function)
const Row kRows[] = {VELLUM_VALIDATED_COMMANDS(VELLUM_ROW) VELLUM_VALIDATED_NEWER_COMMANDS(VELLUM_NEWER_ROW)};
#undef VELLUM_ROW
#undef VELLUM_NEWER_ROW

} // namespace

PFN_vkVoidFunction validatedCommand(const char *name)
{
    const char *command = commandOf(name);
    const auto *row = std::ranges::find_if(kRows, [=](const Row &r) { return std::strcmp(r.command, command) == 0; });
    return row == std::end(kRows) ? nullptr : row->function;
}

} // namespace vellum::layer
