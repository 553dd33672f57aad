// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/command_log.h"

#include <algorithm>
#include <chrono>

#include "layer/base/report.h"

namespace vellum::layer
{

void CommandLog::reset()
{
    // A submission of it that is complete may not have run its steps.
    if (steps.use_count() > 1 || !steps->checks.empty() || !steps->effects.empty())
        steps = std::make_shared<Steps>();
    accessed.reset();
    traces = {};
    isRecording = isRendering = suspends = isSuspended = false;
}

void CommandLogs::addCheck(VkCommandBuffer commandBuffer, CommandLog::Step check)
{
    if (const auto log = get(commandBuffer))
        log->steps->checks.push_back(std::move(check));
}

void CommandLogs::add(VkCommandBuffer commandBuffer, CommandLog::Step effect)
{
    if (!commandBuffer) {
        const HeldMessages held;
        const std::lock_guard lock(submissions);
        effect({});
    } else if (const auto log = get(commandBuffer)) {
        log->steps->effects.push_back(std::move(effect));
    }
}

bool CommandLogs::waitForEarlier(std::unique_lock<std::mutex> &lock, uint64_t turn)
{
    constexpr std::chrono::milliseconds kPatience{100};
    const auto isOver = [&] {
        return std::all_of(begun_.begin(), begun_.lower_bound(turn), [](const auto &other) { return other.second; });
    };
    known_.wait_for(lock, kPatience, isOver);
    for (auto other = begun_.begin(); other != begun_.lower_bound(turn); ++other)
        other->second = true;
    return begun_.empty() || begun_.begin()->first >= turn;
}

void CommandLogs::settle()
{
    std::unique_lock lock(submissions);
    waitForEarlier(lock, turns_ + 1);
}

SubmissionTurn::SubmissionTurn(CommandLogs &logs) : logs_(logs)
{
    const std::lock_guard lock(logs.submissions);
    number_ = logs.turns_ + 1;
    logs.begun_[number_] = false;
    logs.turns_ = number_;
}

SubmissionTurn::~SubmissionTurn()
{
    if (!lock_.owns_lock())
        lock_ = std::unique_lock(logs_.submissions);
    logs_.begun_.erase(number_);
    logs_.known_.notify_all();
}

bool SubmissionTurn::await()
{
    lock_ = std::unique_lock(logs_.submissions);
    const bool first = logs_.waitForEarlier(lock_, number_);
    return first && !logs_.begun_[number_];
}

} // namespace vellum::layer
