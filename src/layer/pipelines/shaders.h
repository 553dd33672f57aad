// SPDX-License-Identifier: Apache-2.0
// Shader modules, shader objects, compute and graphics pipelines: the driver gets rewritten shaders (driver_stages.h).
#pragma once

#include <algorithm>
#include <deque>
#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pipeline_info.h"
#include "layer/base/pnext.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/module_identifiers.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DevicePipelines;
struct Driver;

// All flags of pipelines about opacity micromaps. Only the first changes what the layer does; the others are promises.
inline constexpr VkFlags64 kMicromapPipelineFlags =
    VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT | VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM |
    VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;

// The flags of kMicromapPipelineFlags that the driver does not know.
VkFlags64 unknownPipelineFlags(const Driver &driver);

// Removes and adds flags in a create info, with a copy of its VkPipelineCreateFlags2CreateInfo in `chains` if that
// changes. Returns false and reports an error if that structure is behind one of unknown size.
bool changePipelineFlags(const Driver &driver, const void *&pNext, VkPipelineCreateFlags &flags, VkFlags64 removed,
                         VkFlags64 added, std::deque<Chain> &chains, const char *command);

// Owns all that the create info of a compute or graphics pipeline points to once it is one for the driver.
class DriverPipelineInfo
{
public:
    explicit DriverPipelineInfo(DevicePipelines &device) : identifiers(device), device_(device), stages_(device) {}
    // Changes a create info into the driver's. It is valid as long as this object.
    VkResult change(VkComputePipelineCreateInfo &info);
    VkResult change(VkGraphicsPipelineCreateInfo &info);

    DriverIdentifiers identifiers;

private:
    template <typename Info>
    VkResult change(Info &info, const VkPipelineShaderStageCreateInfo *&stages, uint32_t count, const char *command);
    VkResult changeGroups(VkGraphicsPipelineCreateInfo &info);

    DevicePipelines &device_;
    DriverStages stages_;
    std::vector<VkGraphicsShaderGroupCreateInfoNV> groups_;
    std::deque<Chain> chains_;
};

// --- commands that create several objects. A pipeline that fails does not keep the command from creating the others,
// unless it has EARLY_RETURN_ON_FAILURE (Vulkan, "Multiple Pipeline Creation") ---

template <typename Info>
bool returnsEarly(const Info &info)
{
    return (pipelineFlags(info.pNext, info.flags) & VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT) != 0;
}

// The result of `prepare` for each create info, up to one that fails and has EARLY_RETURN_ON_FAILURE.
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

// Creates pipelines one by one. `create(i, info, pipeline)` creates one, whose create info has no basePipelineIndex.
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

// Creates the pipelines whose preparation succeeded, by one call if it succeeded for all. `create(count, infos,
// pipelines)` is the driver's command.
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

} // namespace vellum::layer
