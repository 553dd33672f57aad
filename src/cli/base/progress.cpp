// SPDX-License-Identifier: Apache-2.0
#include "cli/base/progress.h"

#include <cstdio>

#include "cli/base/system/streams.h"

namespace vellum::cli
{

Progress::Progress(std::string what, bool enabled)
    : what_(std::move(what)), enabled_(enabled && !disabled_ && isTerminal(stderr))
{
    if (enabled_)
        std::fprintf(stderr, "\r\033[K%s ...", what_.c_str());
}

Progress::~Progress()
{
    if (enabled_)
        std::fprintf(stderr, "\r\033[K");
}

void Progress::update(size_t done, size_t total)
{
    const int percent = total == 0 ? 100 : static_cast<int>(100 * done / total);
    if (!enabled_ || percent == shown_)
        return;
    shown_ = percent;
    std::fprintf(stderr, "\r\033[K%s %3d %%", what_.c_str(), percent);
}

} // namespace vellum::cli
