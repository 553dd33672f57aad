// Work that is divided among threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "bake/bake.h"

namespace vellum
{

// Tells of progress now and then: at most some hundred times in all, and of the end.
class Progress
{
public:
    Progress(const std::function<void(std::size_t, std::size_t)> &callback, std::size_t total)
        : m_callback(callback), m_total(total)
    {
    }
    // From any thread.
    void done(std::size_t count)
    {
        if (!m_callback)
            return;
        const std::lock_guard lock(m_mutex);
        m_done += count;
        if (m_done < m_next && m_done < m_total)
            return;
        m_next = m_done + m_total / 256;
        m_callback(m_done, m_total);
    }

private:
    const std::function<void(std::size_t, std::size_t)> &m_callback;
    std::mutex m_mutex;
    std::size_t m_total;
    std::size_t m_done = 0;
    std::size_t m_next = 0;
};

// Calls function(i, state) for each i below `count`, in any order, on `threads` threads with a State of their own. The
// first exception ends the work and is thrown on.
template <typename State, typename Function>
void inParallel(unsigned threads, std::size_t count, const std::function<bool()> &cancelled, Function &&function)
{
    std::atomic<std::size_t> next{0};
    std::mutex failing;
    std::exception_ptr failure;
    const auto work = [&] {
        try {
            State state;
            for (std::size_t i = next++; i < count; i = next++) {
                if (cancelled && cancelled())
                    throw BakeCancelled();
                function(i, state);
            }
        } catch (...) {
            const std::lock_guard lock(failing);
            if (!failure)
                failure = std::current_exception();
            next = count;
        }
    };
    {
        std::vector<std::jthread> others;
        try {
            for (std::size_t i = 1; i < threads && i < count; ++i)
                others.emplace_back(work);
        } catch (const std::exception &) {
            // Without memory or permission for another thread, those that there are do the work.
        }
        work();
    }
    if (failure)
        std::rethrow_exception(failure);
}

} // namespace vellum
