// SPDX-License-Identifier: Apache-2.0
// Progress of work that several threads do.
#pragma once

#include <cstddef>
#include <functional>
#include <mutex>

namespace vellum
{

// Calls back now and then, at most some hundred times in all, and at the end.
class Progress
{
public:
    Progress(const std::function<void(size_t, size_t)> &callback, size_t total) : callback_(callback), total_(total) {}
    // From any thread.
    void done(size_t count)
    {
        if (!callback_)
            return;
        const std::lock_guard lock(mutex_);
        done_ += count;
        if (done_ < next_ && done_ < total_)
            return;
        next_ = done_ + total_ / 256;
        callback_(done_, total_);
    }

private:
    const std::function<void(size_t, size_t)> &callback_;
    std::mutex mutex_;
    size_t total_;
    size_t done_ = 0;
    size_t next_ = 0;
};

} // namespace vellum
