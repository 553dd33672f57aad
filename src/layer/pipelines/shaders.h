// Shader modules, shader objects, compute and graphics pipelines: shaders that trace rays are rewritten on their way to
// the driver.
#pragma once

#include <algorithm>
#include <deque>
#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/base/vulkan_newer.h"
#include "layer/pipelines/pipeline_flags.h"

namespace vellum::layer
{

struct DevicePipelines;
class DriverIdentifiers;
class DriverStages;

// Makes a create info one as the driver is to see it. What it points to then lives in the other arguments. Without
// emulated micromaps only its identifiers change.
VkResult translate(DevicePipelines &device, VkComputePipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains);
VkResult translate(DevicePipelines &device, VkGraphicsPipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains);

VkResult createShaderModule(DevicePipelines &, VkDevice, const VkShaderModuleCreateInfo *,
                            const VkAllocationCallbacks *, VkShaderModule *);
void destroyShaderModule(DevicePipelines &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createComputePipelines(DevicePipelines &, VkDevice, VkPipelineCache, uint32_t,
                                const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createGraphicsPipelines(DevicePipelines &, VkDevice, VkPipelineCache, uint32_t,
                                 const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createShaders(DevicePipelines &, VkDevice, uint32_t, const newer::ShaderCreateInfo *,
                       const VkAllocationCallbacks *, newer::ShaderEXT *);

// --- commands that make several objects at once. Pipelines that can be made are made also where others of the command
// cannot be, unless one that fails has EARLY_RETURN_ON_FAILURE (Vulkan, "Multiple Pipeline Creation") ---

template <typename Info>
bool returnsEarly(const Info &info)
{
    return (pipelineFlags(info.pNext, info.flags) & VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT) != 0;
}

// The result of `prepare` for each create info, up to one that fails and ends the command.
template <typename Info, typename Prepare>
std::vector<VkResult> prepareEach(std::span<Info> infos, Prepare prepare)
{
    std::vector<VkResult> results;
    for (Info &info : infos) {
        const bool early = returnsEarly(info);
        results.push_back(prepare(info));
        if (results.back() != VK_SUCCESS && early)
            break;
    }
    return results;
}

inline bool allSucceeded(const std::vector<VkResult> &results)
{
    return std::ranges::all_of(results, [](VkResult result) { return result == VK_SUCCESS; });
}

// Makes pipelines one after the other. `create(i, info, pipeline)` makes one; its create info names no other by index.
template <typename Info, typename Create>
VkResult createEach(std::span<Info> infos, VkPipeline *pipelines, Create create)
{
    VkResult worst = VK_SUCCESS;
    std::fill_n(pipelines, infos.size(), VK_NULL_HANDLE);
    for (size_t i = 0; i < infos.size(); ++i) {
        auto info = infos[i];
        const bool derived = (pipelineFlags(info.pNext, info.flags) & VK_PIPELINE_CREATE_DERIVATIVE_BIT) != 0 &&
                             info.basePipelineIndex >= 0 && static_cast<size_t>(info.basePipelineIndex) < i;
        if (derived) {
            info.basePipelineHandle = pipelines[info.basePipelineIndex];
            info.basePipelineIndex = -1;
        }
        const bool baseFailed = derived && !info.basePipelineHandle;
        const VkResult result = baseFailed ? worst : create(i, info, pipelines[i]);
        if (result < 0 || worst == VK_SUCCESS)
            worst = result;
        if (result != VK_SUCCESS && returnsEarly(info))
            break;
    }
    return worst;
}

// Makes the pipelines that were prepared: with one call where these are all. `create(count, infos, pipelines)` is the
// driver's command.
template <typename Info, typename Create>
VkResult createPrepared(std::span<Info> infos, const std::vector<VkResult> &prepared, VkPipeline *pipelines,
                        Create create)
{
    if (allSucceeded(prepared))
        return create(static_cast<uint32_t>(infos.size()), infos.data(), pipelines);
    return createEach(infos, pipelines, [&](size_t i, const Info &info, VkPipeline &pipeline) {
        return prepared[i] == VK_SUCCESS ? create(1u, &info, &pipeline) : prepared[i];
    });
}

// Shader objects. An error is about the first that is null, so only those before one that fails in `prepare` are made.
// `create(count)` is the driver's command for the first ones.
template <typename Prepare, typename Create>
VkResult createShadersBeforeFailure(std::span<newer::ShaderCreateInfo> infos, newer::ShaderEXT *shaders,
                                    Prepare prepare, Create create)
{
    std::fill_n(shaders, infos.size(), nullptr);
    VkResult failure = VK_SUCCESS;
    uint32_t count = 0;
    while (count < infos.size() && failure == VK_SUCCESS) {
        failure = prepare(infos[count]);
        count += failure == VK_SUCCESS ? 1 : 0;
    }
    const VkResult result = count > 0 ? create(count) : VK_SUCCESS;
    return result == VK_SUCCESS ? failure : result;
}

} // namespace vellum::layer
