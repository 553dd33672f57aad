#include "cli/base/progress.h"

#include <cstdio>
#include <unistd.h>

namespace vellum::cli
{

Progress::Progress(std::string what, bool enabled)
    : m_what(std::move(what)), m_enabled(enabled && isatty(STDERR_FILENO) == 1)
{
    if (m_enabled)
        std::fprintf(stderr, "\r\033[K%s ...", m_what.c_str());
}

Progress::~Progress()
{
    if (m_enabled)
        std::fprintf(stderr, "\r\033[K");
}

void Progress::update(std::size_t done, std::size_t total)
{
    const int percent = total == 0 ? 100 : static_cast<int>(100 * done / total);
    if (!m_enabled || percent == m_shown)
        return;
    m_shown = percent;
    std::fprintf(stderr, "\r\033[K%s %3d %%", m_what.c_str(), percent);
}

} // namespace vellum::cli
