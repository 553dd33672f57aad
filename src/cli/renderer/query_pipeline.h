// SPDX-License-Identifier: Apache-2.0
// The picture by ray queries: one compute shader, shaders/render.comp.
#pragma once

#include "cli/renderer/trace_pipeline.h"

namespace vellum::cli
{

class QueryPipeline final : public TracePipeline
{
public:
    QueryPipeline(Device &device, const TracePipelineInfo &info);
    ~QueryPipeline() override;

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override;

private:
    Device &device_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

} // namespace vellum::cli
