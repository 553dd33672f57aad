// SPDX-License-Identifier: Apache-2.0
// The commands that run shaders, which may trace rays.
#pragma once

#include "layer/validation/device_validation.h"

namespace vellum::layer
{

void bindTracingPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline);
void bindTracingShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const newer::ShaderEXT *shaders);
// `command` runs what is bound.
void runTracing(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                const char *command);

struct TracingCommand {
    const char *name;
    VkPipelineBindPoint point;
};

template <auto next>
struct Traced;
template <typename... Arguments, void (VKAPI_PTR *NextCommands::*next)(VkCommandBuffer, Arguments...)>
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

#define VELLUM_TRACED(name, function, bindPoint)                                                                       \
    inline constexpr TracingCommand k##name{"vk" #name, VK_PIPELINE_BIND_POINT_##bindPoint};                           \
    inline constexpr auto function = &Traced<&NextCommands::name>::call<k##name>;
#define VELLUM_DRAW(name, function) VELLUM_TRACED(name, function, GRAPHICS)
#define VELLUM_DISPATCH(name, function) VELLUM_TRACED(name, function, COMPUTE)
#define VELLUM_TRACE(name, function) VELLUM_TRACED(name, function, RAY_TRACING_KHR)
VELLUM_DRAW_COMMANDS(VELLUM_DRAW)
#define VELLUM_NEWER_DISPATCH(name, type, function) VELLUM_DISPATCH(name, function)
VELLUM_DISPATCH_COMMANDS(VELLUM_DISPATCH)
VELLUM_NEWER_DISPATCH_COMMANDS(VELLUM_NEWER_DISPATCH)
VELLUM_TRACE_COMMANDS(VELLUM_TRACE)
VELLUM_TRACED(CmdSubpassShadingHUAWEI, cmdSubpassShading, SUBPASS_SHADING_HUAWEI)
#undef VELLUM_NEWER_DISPATCH
#undef VELLUM_TRACE
#undef VELLUM_DISPATCH
#undef VELLUM_DRAW
#undef VELLUM_TRACED

// They run what is bound, except with a set of pipelines or shader objects, of which the device chooses.
void cmdExecuteGeneratedCommandsNV(DeviceValidation &, VkCommandBuffer, VkBool32, const VkGeneratedCommandsInfoNV *);
void cmdExecuteGeneratedCommandsEXT(DeviceValidation &, VkCommandBuffer, VkBool32,
                                    const newer::GeneratedCommandsInfo *);

} // namespace validation
} // namespace vellum::layer
