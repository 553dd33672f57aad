// SPDX-License-Identifier: Apache-2.0
// Commands of subsystems as the functions that Vulkan calls.
#pragma once

#include <cstdio>
#include <exception>
#include <type_traits>

#include "layer/entry/device.h"

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

} // namespace vellum::layer
