// SPDX-License-Identifier: Apache-2.0
#include "sync_objects.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <optional>

namespace vellum::test::kernel
{

u32 SyncObjects::create(bool signaled)
{
    std::lock_guard lock(mutex_);
    values_[++last_] = signaled ? 1 : 0;
    return last_;
}

int SyncObjects::destroy(u32 handle)
{
    std::lock_guard lock(mutex_);
    return values_.erase(handle) == 1 ? 0 : ENOENT;
}

int SyncObjects::reset(std::span<const u32> handles)
{
    std::lock_guard lock(mutex_);
    for (const u32 handle : handles) {
        const auto found = values_.find(handle);
        if (found == values_.end())
            return ENOENT;
        found->second = 0;
    }
    return 0;
}

int SyncObjects::signal(u32 handle, u64 point)
{
    std::lock_guard lock(mutex_);
    const auto found = values_.find(handle);
    if (found == values_.end())
        return ENOENT;
    found->second = std::max(found->second, std::max<u64>(point, 1));
    changed_.notify_all();
    return 0;
}

int SyncObjects::value(u32 handle, u64 &value)
{
    std::lock_guard lock(mutex_);
    const auto found = values_.find(handle);
    if (found == values_.end())
        return ENOENT;
    value = found->second;
    return 0;
}

int SyncObjects::wait(std::span<const u32> handles, std::span<const u64> points, int64_t deadline, u32 flags,
                      u32 &first)
{
    std::unique_lock lock(mutex_);
    std::optional<int> result;
    const auto done = [&] {
        size_t signaled = 0;
        for (size_t i = 0; i < handles.size() && !result; ++i) {
            const auto found = values_.find(handles[i]);
            const u64 point = points.empty() ? 1 : std::max<u64>(points[i], 1);
            if (found == values_.end())
                result = ENOENT;
            else if (found->second >= point && signaled++ == 0)
                first = static_cast<u32>(i);
            else if (found->second < point && (flags & (kWaitForSubmit | kWaitAvailable)) == 0)
                result = EINVAL; // the kernel waits for work to be submitted only if a flag says so
        }
        if (!result && ((flags & kWaitAll) != 0 ? signaled == handles.size() : signaled > 0))
            result = 0;
        return result.has_value();
    };
    // Deadlines count from the beginning of the steady clock, and may be larger than its range.
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::nanoseconds left = std::chrono::nanoseconds(deadline) - now.time_since_epoch();
    changed_.wait_until(
        lock, now + std::clamp<std::chrono::nanoseconds>(left, std::chrono::nanoseconds(0), std::chrono::hours(1)),
        done);
    return result.value_or(ETIME);
}

} // namespace vellum::test::kernel
