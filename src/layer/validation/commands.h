// SPDX-License-Identifier: Apache-2.0
// The commands that validation intercepts: each checks, records what it changes in the model, and calls the
// implementation.
#pragma once

#include "layer/base/commands.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/ranges/ranges.h"

namespace vellum::layer
{

// Returns whether a host command was carried out. One that is deferred counts as done: its order is the application's.
inline bool isCarriedOut(VkResult result)
{
    return result >= 0;
}

// A command of which validation checks the address ranges, what rays meet in the shaders that it runs, or both.
struct CheckedCommand {
    const char *name;
    VkPipelineBindPoint point = VK_PIPELINE_BIND_POINT_MAX_ENUM; // that of the shaders; none: it runs no shaders
};
template <auto next>
struct PassedOn;
template <typename... Arguments, void (VKAPI_PTR *DeviceTable::*next)(VkCommandBuffer, Arguments...)>
struct PassedOn<next> {
    // `check`: of the ranges; null: it takes none.
    template <const CheckedCommand &command, auto check>
    static void call(DeviceValidation &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        const auto passOn = [&] {
            runTracing(device.traces, commandBuffer, command.point, command.name);
            (device.next.*next)(commandBuffer, arguments...);
        };
        // With sanitizers, GCC compares no addresses of functions in constant expressions.
        if constexpr (std::is_null_pointer_v<decltype(check)>) {
            passOn();
        } else {
            const CheckedRanges checked(device, commandBuffer, command.name,
                                        [&](const RangeCheck &ranges) { check(ranges, arguments...); });
            passOn();
        }
    }
};

template <auto function>
struct Forwarded;
template <typename... Arguments, void (*function)(DeviceCommandBuffers &, VkCommandBuffer, Arguments...)>
struct Forwarded<function> {
    static void call(DeviceValidation &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        function(device.commands, commandBuffer, arguments...);
    }
};

namespace validation
{

#define VELLUM_VALIDATOR(command, function, ...) WithPart<DeviceValidation, PFN_vk##command>::Function function;
#define VELLUM_DEVICE(command, scope, implementation, ...) __VA_OPT__(VELLUM_VALIDATOR(command, __VA_ARGS__))
#define VELLUM_STATE(command, scope, implementation, function)                                                         \
    inline constexpr auto function = &Forwarded<layer::implementation>::call;
#define VELLUM_PASSED_ON(bindPoint, check, command, function)                                                          \
    inline constexpr CheckedCommand k##command{"vk" #command, VK_PIPELINE_BIND_POINT_##bindPoint};                     \
    inline constexpr auto function = &PassedOn<&DeviceTable::command>::call<k##command, check>;
#define VELLUM_TRACED(bindPoint, command, scope, implementation, function)                                             \
    VELLUM_PASSED_ON(bindPoint, nullptr, command, function)
#define VELLUM_DRAW(...) VELLUM_TRACED(GRAPHICS, __VA_ARGS__)
#define VELLUM_DISPATCH(...) VELLUM_TRACED(COMPUTE, __VA_ARGS__)
#define VELLUM_TRACE(...) VELLUM_TRACED(RAY_TRACING_KHR, __VA_ARGS__)
#define VELLUM_SUBPASS_SHADING(...) VELLUM_TRACED(SUBPASS_SHADING_HUAWEI, __VA_ARGS__)
#define VELLUM_RANGED(bindPoint, command, scope, implementation, function, ...)                                        \
    VELLUM_PASSED_ON(bindPoint, ranges::function, command, function)
#define VELLUM_RANGES(...) VELLUM_RANGED(MAX_ENUM, __VA_ARGS__)
#define VELLUM_RANGES_DRAW(...) VELLUM_RANGED(GRAPHICS, __VA_ARGS__)
#define VELLUM_RANGES_DISPATCH(...) VELLUM_RANGED(COMPUTE, __VA_ARGS__)
#include "layer/base/commands.inc"
#undef VELLUM_VALIDATOR
#undef VELLUM_PASSED_ON
#undef VELLUM_TRACED
#undef VELLUM_RANGED

} // namespace validation
} // namespace vellum::layer
