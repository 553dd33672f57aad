// The part of the ray flag probe that traces its ray with a ray tracing pipeline.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/commands/injected_work.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

class RayFlagPipelineProbe
{
public:
    explicit RayFlagPipelineProbe(const GpuContext &context) : context_(context) {}
    ~RayFlagPipelineProbe();
    RayFlagPipelineProbe(const RayFlagPipelineProbe &) = delete;
    RayFlagPipelineProbe &operator=(const RayFlagPipelineProbe &) = delete;

    // Records the trace. It leaves the flags that the any-hit and the closest-hit shader saw at push.result, zero where
    // a shader did not run. False where the driver could not make what is needed; this object must outlive the
    // execution.
    bool record(VkCommandBuffer commands, const shared::RayFlagProbePush &push);

private:
    bool createPipeline();
    bool createTable();

    const GpuContext &context_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    GpuBuffer table_;
};

} // namespace vellum::layer
