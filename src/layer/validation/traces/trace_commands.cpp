// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/traces/trace_commands.h"

namespace vellum::layer
{
namespace
{

constexpr VkShaderStageFlags kRayTracingStages =
    VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
    VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;

VkPipelineBindPoint pointOf(VkShaderStageFlagBits stage)
{
    return stage == VK_SHADER_STAGE_COMPUTE_BIT ? VK_PIPELINE_BIND_POINT_COMPUTE : VK_PIPELINE_BIND_POINT_GRAPHICS;
}

bool isKnown(VkPipelineBindPoint point)
{
    return point == VK_PIPELINE_BIND_POINT_GRAPHICS || point == VK_PIPELINE_BIND_POINT_COMPUTE ||
           point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR || point == VK_PIPELINE_BIND_POINT_SUBPASS_SHADING_HUAWEI;
}

// A site of the code that a submitted command runs, with the set that was bound. What structures hold is unknown where
// the order of submissions is.
void useSite(DeviceValidation &device, const TracingSite &site, const StructureSet *set, bool isOrdered, TraceUse use)
{
    use.number = ++device.numbers;
    const auto useStructure = [&](const std::shared_ptr<ValidatedStructure> &structure) {
        use.contents = structure && isOrdered ? structure->contents : nullptr;
        use.structure = structure;
        device.traces.marks.use(site.mark->index(), use);
    };
    const auto structures =
        set ? device.traces.descriptors.structures(*set, site.binding->binding, site.binding->element)
            : std::vector<std::shared_ptr<ValidatedStructure>>{};
    for (const auto &structure : structures)
        useStructure(structure);
    if (structures.empty())
        useStructure(nullptr);
}

} // namespace

void bindTracingPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline)
{
    if (!device.gpu.on || !isKnown(point))
        return;
    const auto log = device.logs.get(commandBuffer);
    if (!log)
        return;
    auto &code = log->traces.at(point).code;
    code.clear();
    if (auto bound = device.traces.pipelines.get(pipeline))
        code[0] = std::move(bound);
}

void bindTracingShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders)
{
    const auto log = device.gpu.on ? device.logs.get(commandBuffer) : nullptr;
    for (uint32_t i = 0; log && i < count; ++i) {
        auto &code = log->traces.at(pointOf(stages[i])).code;
        code.erase(0);
        code.erase(stages[i]);
        if (auto bound = shaders ? device.traces.shaders.get(shaders[i]) : nullptr)
            code[stages[i]] = std::move(bound);
    }
}

void runTracing(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point, const char *command)
{
    const auto log = device.gpu.on ? device.logs.get(commandBuffer) : nullptr;
    if (!log)
        return;
    PointBindings &bindings = log->traces.at(point);
    for (const auto &[stage, code] : bindings.code) {
        for (const TracingSite &site : code->sites) {
            const auto bound = bindings.sets.find(site.binding->set);
            auto set = bound == bindings.sets.end() ? nullptr : bound->second;
            device.logs.add(commandBuffer, [&device, &site, command, code = code, set](const Submission &submission) {
                useSite(device, site, set.get(), submission.ordered,
                        {.command = command,
                         .code = code->handle,
                         .shaderObject = code->shaderObject,
                         .structure = {},
                         .contents = {}});
            });
        }
    }
}

namespace validation
{

void cmdExecuteGeneratedCommandsNV(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBool32 isPreprocessed,
                                   const VkGeneratedCommandsInfoNV *info)
{
    if (isKnown(info->pipelineBindPoint))
        runTracing(device, commandBuffer, info->pipelineBindPoint, "vkCmdExecuteGeneratedCommandsNV");
    device.next.CmdExecuteGeneratedCommandsNV(commandBuffer, isPreprocessed, info);
}

void cmdExecuteGeneratedCommandsEXT(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBool32 isPreprocessed,
                                    const VkGeneratedCommandsInfoEXT *info)
{
    const VkPipelineBindPoint point =
        (info->shaderStages & VK_SHADER_STAGE_COMPUTE_BIT) != 0 ? VK_PIPELINE_BIND_POINT_COMPUTE
        : (info->shaderStages & kRayTracingStages) != 0         ? VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR
                                                                : VK_PIPELINE_BIND_POINT_GRAPHICS;
    if (info->indirectExecutionSet == 0)
        runTracing(device, commandBuffer, point, "vkCmdExecuteGeneratedCommandsEXT");
    device.next.CmdExecuteGeneratedCommandsEXT(commandBuffer, isPreprocessed, info);
}

} // namespace validation
} // namespace vellum::layer
