// SPDX-License-Identifier: Apache-2.0
#include "cli/run/program.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

volatile sig_atomic_t child = 0;

void passOn(int signal, siginfo_t *info, void *)
{
    // A terminal sends Ctrl-C to the program as well.
    if (info->si_code == SI_USER && child > 0)
        kill(child, signal);
}

// While there is one, signals that end processes are passed on instead.
class PassedOnSignals
{
public:
    PassedOnSignals()
    {
        struct sigaction handler {
        };
        handler.sa_sigaction = passOn;
        handler.sa_flags = SA_SIGINFO | SA_RESTART;
        sigemptyset(&set_);
        for (size_t i = 0; i < kSignals.size(); ++i) {
            sigaddset(&set_, kSignals[i]);
            sigaction(kSignals[i], nullptr, &before_[i]);
            if (before_[i].sa_handler != SIG_IGN) // the program inherits that
                sigaction(kSignals[i], &handler, nullptr);
        }
    }
    ~PassedOnSignals()
    {
        for (size_t i = 0; i < kSignals.size(); ++i)
            sigaction(kSignals[i], &before_[i], nullptr);
    }
    PassedOnSignals(const PassedOnSignals &) = delete;
    PassedOnSignals &operator=(const PassedOnSignals &) = delete;

    [[nodiscard]] const sigset_t &set() const { return set_; }

private:
    static constexpr std::array<int, 4> kSignals{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    sigset_t set_{};
    std::array<struct sigaction, kSignals.size()> before_{};
};

// The error of posix_spawnp; 0: it runs, as `child`.
int start(std::span<const std::string> words, const sigset_t &signals)
{
    std::vector<std::string> copy(words.begin(), words.end());
    std::vector<char *> arguments;
    for (std::string &word : copy)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    // No signal comes between the start and the assignment to `child`.
    sigset_t before;
    sigprocmask(SIG_BLOCK, &signals, &before);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    posix_spawnattr_setsigmask(&attributes, &before);
    pid_t process = 0;
    const int error = posix_spawnp(&process, arguments[0], nullptr, &attributes, arguments.data(), environ);
    posix_spawnattr_destroy(&attributes);
    child = error == 0 ? process : 0;
    sigprocmask(SIG_SETMASK, &before, nullptr);
    return error;
}

} // namespace

int runProgram(std::span<const std::string> words)
{
    const PassedOnSignals signals;
    if (const int error = start(words, signals.set()); error != 0) {
        std::fprintf(stderr, "vellum: %s: %s\n", words[0].c_str(), std::strerror(error));
        return error == ENOENT ? 127 : 126;
    }
    int status = 0;
    while (waitpid(child, &status, 0) < 0)
        if (errno != EINTR)
            throw Error("the program cannot be waited for");
    child = 0;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

} // namespace vellum::cli
