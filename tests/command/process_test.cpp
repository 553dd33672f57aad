// SPDX-License-Identifier: Apache-2.0
// What a process gets from the one that starts it.
#include "base/process.h"

#include <csignal>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

using namespace vellum;

namespace
{

// Runs a function in a process of its own. Returns what the function returns, or -1 if a signal ended it.
template <typename Function>
int inProcess(Function &&function)
{
    const pid_t child = fork();
    if (child == 0)
        _exit(function());
    int status = 0;
    return waitpid(child, &status, 0) == child && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

} // namespace

TEST(Process, NoFileBecomesAStandardStream)
{
    const int faults = inProcess([] {
        for (const int stream : {0, 1, 2})
            close(stream);
        prepareProcess(0, nullptr);
        const bool apart = open("/dev/null", O_RDWR | O_CLOEXEC) > 2;
        char byte = 0;
        const bool closed = read(0, &byte, 1) < 0 && write(1, &byte, 1) < 0 && write(2, &byte, 1) < 0;
        const bool inherited = runProgram(std::vector<std::string>{"sh", "-c", "exec 3<&0"}, {}).code == 0;
        return int{!apart} + 2 * int{!closed} + 4 * int{inherited};
    });
    EXPECT_EQ(faults, 0);
}

TEST(Process, ChildrenAreWaitedForWhereTheParentIgnoresTheirEnd)
{
    const int code = inProcess([] {
        std::signal(SIGCHLD, SIG_IGN);
        prepareProcess(0, nullptr);
        try {
            return runProgram(std::vector<std::string>{"sh", "-c", "exit 3"}, {}).code;
        } catch (const std::exception &) {
            return 1;
        }
    });
    EXPECT_EQ(code, 3);
}
