// SPDX-License-Identifier: Apache-2.0
#include "base/progress.h"

#include <cstdio>

#include "base/files.h"

namespace vellum
{

ProgressLine::ProgressLine(std::string what, bool enabled)
    : what_(std::move(what)), enabled_(enabled && !disabled_ && isTerminal(stderr))
{
    if (enabled_)
        std::fprintf(stderr, "\r\033[K%s ...", what_.c_str());
}

ProgressLine::ProgressLine(std::string what, double secondsBetweenLines) : ProgressLine(std::move(what))
{
    lines_ = !enabled_ && !disabled_ && secondsBetweenLines > 0;
    if (lines_)
        pause_ = secondsBetweenLines;
}

ProgressLine::~ProgressLine()
{
    if (enabled_)
        std::fprintf(stderr, "\r\033[K");
}

void ProgressLine::update(size_t done, size_t total)
{
    const int percent = total == 0 ? 100 : static_cast<int>(100 * done / total);
    if (!enabled_ || percent == shown_)
        return;
    shown_ = percent;
    std::fprintf(stderr, "\r\033[K%s %3d %%", what_.c_str(), percent);
}

void ProgressLine::update(const std::function<std::string()> &words)
{
    const auto now = std::chrono::steady_clock::now();
    if ((!enabled_ && !lines_) || std::chrono::duration<double>(now - last_).count() < pause_)
        return;
    last_ = now;
    const std::string line = what_ + ": " + words();
    if (enabled_)
        std::fprintf(stderr, "\r\033[K%s", line.substr(0, terminalWidth().value_or(80) - 1).c_str());
    else
        std::fprintf(stderr, "vellum: %s\n", line.c_str());
}

} // namespace vellum
