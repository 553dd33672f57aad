// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/command_log.h"

#include "layer/base/report.h"

namespace vellum::layer
{

void CommandLog::reset()
{
    steps.clear();
    traces = {};
    isRecording = isRendering = suspends = isSuspended = false;
}

void CommandLogs::add(VkCommandBuffer commandBuffer, std::shared_ptr<CommandLog> log)
{
    const std::lock_guard lock(mutex_);
    pools_[log->pool].insert(commandBuffer);
    logs_.set(commandBuffer, std::move(log));
}

void CommandLogs::remove(VkCommandPool pool, uint32_t count, const VkCommandBuffer *commandBuffers)
{
    const std::lock_guard lock(mutex_);
    const auto known = pools_.find(pool);
    for (uint32_t i = 0; i < count; ++i) {
        logs_.take(commandBuffers[i]);
        if (known != pools_.end())
            known->second.erase(commandBuffers[i]);
    }
}

void CommandLogs::removePool(VkCommandPool pool)
{
    const std::lock_guard lock(mutex_);
    const auto known = pools_.find(pool);
    if (known == pools_.end())
        return;
    for (const VkCommandBuffer commandBuffer : known->second)
        logs_.take(commandBuffer);
    pools_.erase(known);
}

void CommandLogs::clear()
{
    while (!pools_.empty())
        removePool(pools_.begin()->first);
}

void CommandLogs::resetPool(VkCommandPool pool)
{
    const std::lock_guard lock(mutex_);
    if (const auto known = pools_.find(pool); known != pools_.end())
        for (const VkCommandBuffer commandBuffer : known->second)
            if (const auto log = get(commandBuffer))
                log->reset();
}

void CommandLogs::add(VkCommandBuffer commandBuffer, CommandLog::Step step)
{
    if (!commandBuffer) {
        const HeldMessages held;
        const std::lock_guard lock(submissions);
        step({});
    } else if (const auto log = get(commandBuffer)) {
        log->steps.push_back(std::move(step));
    }
}

} // namespace vellum::layer
