// SPDX-License-Identifier: Apache-2.0
// Commands of subsystems and of validation as the functions that Vulkan calls.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <type_traits>

#include "layer/entry/device.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{

// No exception crosses the Vulkan ABI. The layer throws none; the standard library does when memory runs out.
template <typename Result, typename Function>
Result guarded(Function function) noexcept
{
    try {
        return function();
    } catch (const std::exception &) {
        std::fputs("vellum: VELLUM-out-of-memory: out of host memory; the command was not carried out\n", stderr);
    }
    if constexpr (std::is_same_v<Result, VkResult>)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    else if constexpr (!std::is_void_v<Result>)
        return Result{};
}

// A function with the signature that Vulkan calls.
template <auto function>
struct Command;

template <typename Result, typename First, typename... Others, Result(VKAPI_PTR *function)(First, Others...)>
requires(!std::is_reference_v<First>) struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(First first, Others... others) noexcept
    {
        return guarded<Result>([&] { return function(first, others...); });
    }
};

// A command of a subsystem. It gets the subsystem's part of the device.
template <typename Result, typename Subsystem, typename Handle, typename... Arguments,
          Result (*function)(Subsystem &, Handle, Arguments...)>
struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Arguments... arguments) noexcept
    {
        return guarded<Result>(
            [&] { return function(subsystemOf<Subsystem>(deviceOf(handle)), handle, arguments...); });
    }
};

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
            DeviceValidation &device = *deviceOf(handle).validation;
            constexpr VkQueueFlags kQueues = queuesOf(name.text);
            if constexpr (kQueues != 0)
                checkCommand(device, handle, name.text, kQueues);
            return function(device, handle, arguments...);
        });
    }
};

// A command without function.
inline constexpr std::nullptr_t none = nullptr;
template <>
struct Command<none> {
};

template <typename Called>
PFN_vkVoidFunction functionOf()
{
    if constexpr (requires { &Called::call; })
        return reinterpret_cast<PFN_vkVoidFunction>(&Called::call);
    else
        return nullptr;
}

} // namespace vellum::layer
