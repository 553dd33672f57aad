// SPDX-License-Identifier: Apache-2.0
// The shaders of pipelines and shader objects that trace rays. Where a rule about what rays meet may be broken, the
// implementation gets a copy of the shader that sets marks (trace_checks.h).
#pragma once

#include <deque>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/validation/traces/trace_checks.h"
#include "vk/newer.h"

namespace vellum::layer
{

// The create infos of a call, with copies of the shaders in place of those that get marks.
class MarkedPipelines
{
public:
    explicit MarkedPipelines(DeviceTraces &traces) : traces_(traces), device_(traces.device) {}
    MarkedPipelines(const MarkedPipelines &) = delete;
    MarkedPipelines &operator=(const MarkedPipelines &) = delete;
    ~MarkedPipelines();

    void change(VkComputePipelineCreateInfo &info);
    void change(VkGraphicsPipelineCreateInfo &info);
    void change(VkRayTracingPipelineCreateInfoKHR &info);
    // Before the pipelines are created: nothing may fail later, since no other shader may get the marks of theirs.
    void prepare();
    // The pipelines were created.
    void set(uint32_t count, const VkPipeline *pipelines);

private:
    struct Made {
        VkFlags64 flags = 0;
        bool binaries = false; // it has no code
        std::vector<TracingSite> sites;
        std::shared_ptr<TracingCode> code; // null: without sites
        decltype(DeviceTraces::pipelines)::Entry entry;
    };
    void begin(const void *pNext, VkPipelineCreateFlags flags);
    void change(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count);
    void change(VkPipelineShaderStageCreateInfo &stage);
    // Gives the stage other words than its original ones. Returns whether it could.
    bool useCopy(VkPipelineShaderStageCreateInfo &stage, std::span<const uint32_t> original,
                 std::span<const uint32_t> words);
    void addLibraries(const VkPipelineLibraryCreateInfoKHR *libraries);

    DeviceTraces &traces_;
    DeviceModel &device_;
    std::vector<Made> made_;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stages_;
    std::deque<Chain> chains_;
    std::vector<VkShaderModule> modules_;
};

// As above, for shader objects.
class MarkedShaders
{
public:
    explicit MarkedShaders(DeviceTraces &traces) : traces_(traces) {}
    // Nothing fails after change(): shaders with marks have entries.
    void change(VkShaderCreateInfoEXT &info);
    void set(uint32_t count, const VkShaderEXT *shaders);

private:
    DeviceTraces &traces_;
    std::vector<std::shared_ptr<TracingCode>> codes_;
    std::vector<decltype(DeviceTraces::shaders)::Entry> entries_;
    std::deque<std::vector<uint32_t>> words_;
};

} // namespace vellum::layer
