// SPDX-License-Identifier: Apache-2.0
// A loop on several threads, and its progress.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace vellum
{

// The number of threads that an option asks for; 0: one for each processor.
inline unsigned threadCount(unsigned wanted)
{
    return wanted != 0 ? wanted : std::max(1u, std::thread::hardware_concurrency());
}

// Calls function(i, state) for each i below `count`, in any order, on `threads` threads with a State of their own. The
// first exception ends the work and is thrown on.
template <typename State, typename Function>
void inParallel(unsigned threads, size_t count, Function &&function)
{
    std::atomic<size_t> next{0};
    std::mutex failing;
    std::exception_ptr failure;
    const auto work = [&] {
        try {
            State state;
            for (size_t i = next++; i < count; i = next++)
                function(i, state);
        } catch (...) {
            const std::lock_guard lock(failing);
            if (!failure)
                failure = std::current_exception();
            next = count;
        }
    };
    {
        std::vector<std::thread> others;
        try {
            for (size_t i = 1; i < threads && i < count; ++i)
                others.emplace_back(work);
        } catch (const std::exception &) {
            // Without memory or permission for another thread, the existing ones do the work.
        }
        work();
        for (std::thread &other : others)
            other.join();
    }
    if (failure)
        std::rethrow_exception(failure);
}

// As above, without a state: function(i).
template <typename Function>
void inParallel(unsigned threads, size_t count, Function &&function)
{
    struct Nothing {
    };
    inParallel<Nothing>(threads, count, [&](size_t i, Nothing &) { function(i); });
}

// Calls back now and then, at most some hundred times in all, and at the end.
class Progress
{
public:
    Progress(const std::function<void(size_t, size_t)> &callback, size_t total) : callback_(callback), total_(total) {}
    // May be called from any thread.
    void done(uint64_t count)
    {
        if (!callback_)
            return;
        const std::lock_guard lock(mutex_);
        done_ += static_cast<size_t>(count);
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
