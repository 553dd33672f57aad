// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "cli/base/system/streams.h"

namespace vellum::cli
{

bool isTerminal(std::FILE *stream)
{
    return isatty(fileno(stream)) == 1;
}

std::optional<size_t> terminalWidth()
{
    winsize size{};
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0)
        return std::nullopt;
    return size.ws_col;
}

std::FILE *duplicateStdout()
{
    const int copy = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    return copy < 0 ? nullptr : fdopen(copy, "wb");
}

bool sendStdoutToStderr()
{
    return dup2(STDERR_FILENO, STDOUT_FILENO) >= 0;
}

bool discardStdout()
{
    return std::freopen("/dev/null", "w", stdout) != nullptr;
}

} // namespace vellum::cli
