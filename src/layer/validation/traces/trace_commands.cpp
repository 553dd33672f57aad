// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/traces/trace_commands.h"

namespace vellum::layer
{
namespace
{

VkPipelineBindPoint pointOf(VkShaderStageFlagBits stage)
{
    return stage == VK_SHADER_STAGE_COMPUTE_BIT ? VK_PIPELINE_BIND_POINT_COMPUTE : VK_PIPELINE_BIND_POINT_GRAPHICS;
}

bool isKnown(VkPipelineBindPoint point)
{
    return point == VK_PIPELINE_BIND_POINT_GRAPHICS || point == VK_PIPELINE_BIND_POINT_COMPUTE ||
           point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR;
}

// A site of the code that a submitted command runs, with the set that was bound.
void useSite(DeviceValidation &device, const TracingSite &site, const StructureSet *set, TraceUse use)
{
    use.number = ++device.numbers;
    std::vector<std::shared_ptr<ValidatedStructure>> structures;
    if (set)
        structures = device.traces.descriptors.structures(*set, site.binding->binding, site.binding->element);
    if (structures.empty())
        structures.push_back(nullptr);
    for (auto &structure : structures) {
        use.contents = structure ? structure->contents : nullptr;
        use.structure = std::move(structure);
        device.traces.marks.use(site.mark, use);
    }
}

} // namespace

void bindTracingPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline)
{
    const auto log = device.logs.get(commandBuffer);
    if (!log || !isKnown(point))
        return;
    auto &code = log->traces.at(point).code;
    code.clear();
    if (auto bound = device.traces.pipelines.get(pipeline))
        code[0] = std::move(bound);
}

void bindTracingShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const newer::ShaderEXT *shaders)
{
    const auto log = device.logs.get(commandBuffer);
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
    const auto log = device.logs.get(commandBuffer);
    if (!log)
        return;
    PointBindings &bindings = log->traces.at(point);
    for (const auto &[stage, code] : bindings.code) {
        for (const TracingSite &site : code->sites) {
            const auto bound = bindings.sets.find(site.binding->set);
            auto set = bound == bindings.sets.end() ? nullptr : bound->second;
            device.logs.add(commandBuffer, [&device, &site, command, code = code, set](const Submission &) {
                useSite(device, site, set.get(), {.command = command, .code = code, .structure = {}, .contents = {}});
            });
        }
    }
}

} // namespace vellum::layer
