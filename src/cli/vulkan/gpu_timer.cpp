// SPDX-License-Identifier: Apache-2.0
#include "cli/vulkan/gpu_timer.h"

#include <chrono>

#include "vk/vk_init.h"

namespace vellum::cli
{

GpuTimer::GpuTimer(Device &device) : device_(device)
{
    if (!device.hasTimestamps())
        return;
    auto info = vkInit<VkQueryPoolCreateInfo>({.queryType = VK_QUERY_TYPE_TIMESTAMP, .queryCount = 2});
    check(vkCreateQueryPool(device.handle(), &info, nullptr, &timestamps_), "creating a query pool");
}

GpuTimer::~GpuTimer()
{
    vkDestroyQueryPool(device_.handle(), timestamps_, nullptr);
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
    uint64_t ticks[2] = {};
    check(vkGetQueryPoolResults(device_.handle(), timestamps_, 0, 2, sizeof(ticks), ticks, sizeof(ticks[0]),
                                VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
          "reading timestamps");
    return {static_cast<double>(ticks[1] - ticks[0]) * static_cast<double>(device_.limits().timestampPeriod) * 1e-6,
            wall};
}

} // namespace vellum::cli
