// SPDX-License-Identifier: Apache-2.0
// The picture by a ray tracing pipeline: the ray generation shader traces and shades, the any-hit shader does the alpha
// test. One hit group serves all geometry; what is solid is opaque and does not get to the any-hit shader.
#pragma once

#include "cli/renderer/trace_pipeline.h"
#include "cli/vulkan/resources.h"

namespace vellum::cli
{

class RayTracingPipeline final : public TracePipeline
{
public:
    RayTracingPipeline(Device &device, const TracePipelineInfo &info);
    ~RayTracingPipeline() override;

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override;

private:
    explicit RayTracingPipeline(Device &device) : device_(device) {}
    void create(const TracePipelineInfo &info);
    void createTable(const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &limits);

    Device &device_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    uint32_t mostRays_ = 0; // of one vkCmdTraceRaysKHR
    Buffer table_;
    VkStridedDeviceAddressRegionKHR raygen_{}, miss_{}, hit_{}; // in table_
};

} // namespace vellum::cli
