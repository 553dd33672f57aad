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

} // namespace vellum
