// SPDX-License-Identifier: Apache-2.0
#include "gpu/timer.h"

#include <chrono>

namespace vellum::gpu
{

GpuTimer::GpuTimer(Device &device) : device_(device)
{
    if (device.hasTimestamps())
        timestamps_ = QueryPool(device, VK_QUERY_TYPE_TIMESTAMP, 2);
}

void GpuTimer::begin(VkCommandBuffer commands) const
{
    if (timestamps_ == VK_NULL_HANDLE)
        return;
    vkCmdResetQueryPool(commands, timestamps_, 0, 2);
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, timestamps_, 0);
}

void GpuTimer::end(VkCommandBuffer commands) const
{
    if (timestamps_ != VK_NULL_HANDLE)
        vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, timestamps_, 1);
}

Milliseconds GpuTimer::time(const std::function<void()> &submit) const
{
    const auto begin = std::chrono::steady_clock::now();
    submit();
    const double wall = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    if (timestamps_ == VK_NULL_HANDLE)
        return {wall, wall};
    const uint64_t ticks = timestamps_.value(1) - timestamps_.value(0);
    return {static_cast<double>(ticks) * static_cast<double>(device_.limits().timestampPeriod) * 1e-6, wall};
}

} // namespace vellum::gpu
