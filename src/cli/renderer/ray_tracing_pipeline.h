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

    void record(VkCommandBuffer commands, std::uint32_t width, std::uint32_t height) const override;

private:
    explicit RayTracingPipeline(Device &device) : m_device(device) {}
    void create(const TracePipelineInfo &info);
    void createTable(const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &limits);

    Device &m_device;
    VkPipeline m_pipeline = VK_NULL_HANDLE;
    std::uint32_t m_mostRays = 0; // of one vkCmdTraceRaysKHR
    Buffer m_table;
    VkStridedDeviceAddressRegionKHR m_raygen{}, m_miss{}, m_hit{}; // in m_table
};

} // namespace vellum::cli
