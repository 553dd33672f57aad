// SPDX-License-Identifier: Apache-2.0
// A pipeline that draws the picture, by ray queries in a compute shader or by a ray tracing pipeline.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "gpu/device.h"

namespace vellum::render
{

enum class Trace { Query, Pipeline };

// The methods that the device supports, in this order; at least one if it traces rays.
std::vector<Trace> tracesOf(const gpu::DeviceInfo &device);

// The stages in which a pipeline traces.
struct TraceStages {
    VkPipelineBindPoint bindPoint;
    VkPipelineStageFlags pipelineStage;
    VkShaderStageFlags shaders; // stages that use the descriptors and push constants
};
TraceStages stagesOf(Trace trace);

// The specialization constants 0, 1, ... of shaders/scene.glsl.
struct TraceConstants {
    uint32_t textures = 1;
    uint32_t heavyReads = 0;
    VkBool32 counting = VK_FALSE;
    VkBool32 painting = VK_FALSE;
    VkBool32 vertexAlphas = VK_FALSE;
};

struct TracePipelineInfo {
    VkPipelineLayout layout = VK_NULL_HANDLE;
    bool micromaps = false; // the structures that it traces have some
    TraceConstants constants;
};

class TracePipeline
{
public:
    virtual ~TracePipeline() = default;
    TracePipeline(const TracePipeline &) = delete;
    TracePipeline &operator=(const TracePipeline &) = delete;

    // Traces these many pixels. Descriptors and push constants must be bound.
    virtual void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const = 0;

protected:
    TracePipeline() = default;
};

// `device` must outlive the pipeline. Throws gpu::VulkanError or std::runtime_error.
std::unique_ptr<TracePipeline> makeTracePipeline(gpu::Device &device, Trace trace, const TracePipelineInfo &info);

} // namespace vellum::render
