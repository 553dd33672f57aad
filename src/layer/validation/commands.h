// SPDX-License-Identifier: Apache-2.0
// The commands that validation intercepts: each checks, records what it changes in the model, and calls the
// implementation.
#pragma once

#include "layer/validation/device_validation.h"

namespace vellum::layer
{

struct TracingCommand {
    const char *name;
    VkPipelineBindPoint point;
};

// The function that validates a command: it gets the validation of the device before Vulkan's arguments.
template <typename Command>
struct ValidatorOf;
template <typename Result, typename... Arguments>
struct ValidatorOf<Result(VKAPI_PTR *)(Arguments...)> {
    using Type = Result(DeviceValidation &, Arguments...);
};

template <auto next>
struct Traced;
template <typename... Arguments, void (VKAPI_PTR *DeviceTable::*next)(VkCommandBuffer, Arguments...)>
struct Traced<next> {
    template <const TracingCommand &command>
    static void call(DeviceValidation &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        runTracing(device.traces, commandBuffer, command.point, command.name);
        (device.next.*next)(commandBuffer, arguments...);
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

#define VELLUM_VALIDATOR(command, function, ...) ValidatorOf<PFN_vk##command>::Type function;
#define VELLUM_DEVICE(command, scope, implementation, ...) __VA_OPT__(VELLUM_VALIDATOR(command, __VA_ARGS__))
#define VELLUM_STATE(command, scope, implementation, function)                                                         \
    inline constexpr auto function = &Forwarded<layer::implementation>::call;
// Commands that run shaders
#define VELLUM_TRACED(bindPoint, command, scope, implementation, function)                                             \
    inline constexpr TracingCommand k##command{"vk" #command, VK_PIPELINE_BIND_POINT_##bindPoint};                     \
    inline constexpr auto function = &Traced<&DeviceTable::command>::call<k##command>;
#define VELLUM_DRAW(...) VELLUM_TRACED(GRAPHICS, __VA_ARGS__)
#define VELLUM_DISPATCH(...) VELLUM_TRACED(COMPUTE, __VA_ARGS__)
#define VELLUM_TRACE(...) VELLUM_TRACED(RAY_TRACING_KHR, __VA_ARGS__)
#define VELLUM_SUBPASS_SHADING(...) VELLUM_TRACED(SUBPASS_SHADING_HUAWEI, __VA_ARGS__)
#include "layer/base/commands.inc"
#undef VELLUM_VALIDATOR
#undef VELLUM_TRACED

} // namespace validation
} // namespace vellum::layer
