// SPDX-License-Identifier: Apache-2.0
#include "fake_system.h"

#include <csignal>
#include <sys/resource.h>
#include <unistd.h>

namespace vellum::test
{

void crash()
{
    std::raise(SIGSEGV);
}

void letParentStartNothing()
{
    const rlimit few{8, 8};
    prlimit(getppid(), RLIMIT_NOFILE, &few, nullptr);
}

void leaveProcessBehind()
{
    if (fork() == 0) {
        std::signal(SIGTERM, SIG_IGN);
        for (;;)
            pause();
    }
}

bool writeWhereEventsGo(std::string_view text)
{
    return write(3, text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

} // namespace vellum::test
