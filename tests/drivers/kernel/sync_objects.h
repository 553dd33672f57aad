// SPDX-License-Identifier: Apache-2.0
// Synchronization objects as the kernel has them: a number that only grows. A binary object is signaled when it is not
// 0.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <span>

#include "drm_interface.h"

namespace vellum::test::kernel
{

// Every function returns 0 or an error of errno.h.
class SyncObjects
{
public:
    u32 create(bool signaled);
    int destroy(u32 handle);
    int reset(std::span<const u32> handles);
    // A point of 0 signals a binary object.
    int signal(u32 handle, u64 point);
    int value(u32 handle, u64 &value);
    // The simulated GPU never works on anything, so the only possible waits are for other threads.
    int wait(std::span<const u32> handles, std::span<const u64> points, int64_t deadline, u32 flags, u32 &first);

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<u32, u64> values_;
    u32 last_ = 0;
};

} // namespace vellum::test::kernel
