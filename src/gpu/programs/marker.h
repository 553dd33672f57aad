// SPDX-License-Identifier: Apache-2.0
// A compute shader that leaves a mark, by which the host sees whether a dispatch was executed.
#pragma once

#include "gpu/device.h"

namespace vellum::gpu
{

class Marker
{
public:
    explicit Marker(Device &gpu);
    Marker(const Marker &) = delete;
    Marker &operator=(const Marker &) = delete;
    ~Marker();

    // Binds the pipeline, pushes its constants and dispatches it.
    void record(VkCommandBuffer commands) const;
    // Returns whether a dispatch was executed since the last call. None may be pending.
    [[nodiscard]] bool take();

private:
    Device &gpu_;
    Buffer word_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

} // namespace vellum::gpu
