// SPDX-License-Identifier: Apache-2.0
// The commands that run shaders, which may trace rays.
#pragma once

#include "layer/validation/device_validation.h"

namespace vellum::layer
{

void bindTracingPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline);
void bindTracingShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders);
// `command` runs what is bound.
void runTracing(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                const char *command);

struct TracingCommand {
    const char *name;
    VkPipelineBindPoint point;
};

template <auto next>
struct Traced;
template <typename... Arguments, void (VKAPI_PTR *DeviceTable::*next)(VkCommandBuffer, Arguments...)>
struct Traced<next> {
    template <const TracingCommand &command>
    static void call(DeviceValidation &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        runTracing(device, commandBuffer, command.point, command.name);
        (device.next.*next)(commandBuffer, arguments...);
    }
};

namespace validation
{

#define VELLUM_TRACED(bindPoint, command, scope, implementation, function)                                             \
    inline constexpr TracingCommand k##command{"vk" #command, VK_PIPELINE_BIND_POINT_##bindPoint};                     \
    inline constexpr auto function = &Traced<&DeviceTable::command>::call<k##command>;
#define VELLUM_DRAW(...) VELLUM_TRACED(GRAPHICS, __VA_ARGS__)
#define VELLUM_DISPATCH(...) VELLUM_TRACED(COMPUTE, __VA_ARGS__)
#define VELLUM_TRACE(...) VELLUM_TRACED(RAY_TRACING_KHR, __VA_ARGS__)
#define VELLUM_SUBPASS_SHADING(...) VELLUM_TRACED(SUBPASS_SHADING_HUAWEI, __VA_ARGS__)
#include "layer/base/commands.inc"
#undef VELLUM_TRACED

// They run what is bound, except with a set of pipelines or shader objects, of which the device chooses.
void cmdExecuteGeneratedCommandsNV(DeviceValidation &, VkCommandBuffer, VkBool32, const VkGeneratedCommandsInfoNV *);
void cmdExecuteGeneratedCommandsEXT(DeviceValidation &, VkCommandBuffer, VkBool32, const VkGeneratedCommandsInfoEXT *);

} // namespace validation
} // namespace vellum::layer
