// SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <sys/personality.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include "glb_file.h"

namespace vellum::test
{
namespace
{

std::string textOf(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// Called in the child process after fork. `words`: the program, which is not looked up, and its arguments.
[[noreturn]] void execute(std::vector<std::string> words,
                          const std::vector<std::pair<std::string, std::string>> &environment,
                          const std::filesystem::path &output, const std::filesystem::path &errors)
{
    for (const auto &[name, value] : environment)
        setenv(name.c_str(), value.c_str(), 1);
    // Under the sanitizers, only faults count here; drivers keep memory to the end. Deliberate crashes end by their
    // signal.
    setenv("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0:handle_segv=0", 1);
    // Pictures are small: most of the time would go into compiling shaders. See
    // tests/layer/harness/program/test_main.cpp.
    setenv("GALLIVM_PERF", "nopt", 0);
    setenv("MESA_SHADER_CACHE_DIR", VELLUM_TEST_SHADER_CACHE, 0);
#if !defined(__SANITIZE_ADDRESS__)
    personality(ADDR_NO_RANDOMIZE);
#endif
    std::vector<char *> argv;
    for (std::string &word : words)
        argv.push_back(word.data());
    argv.push_back(nullptr);
    if (std::freopen(output.c_str(), "w", stdout) == nullptr || std::freopen(errors.c_str(), "w", stderr) == nullptr)
        _exit(127);
    execv(argv.front(), argv.data());
    _exit(127);
}

// `inChild` is called in the child before it begins, `meanwhile` in the parent, with the child's id.
template <typename InChild, typename Meanwhile>
Outcome runWords(const std::vector<std::string> &words,
                 const std::vector<std::pair<std::string, std::string>> &environment, InChild &&inChild,
                 Meanwhile &&meanwhile, const std::filesystem::path &device = {})
{
    const TemporaryFolder folder;
    std::fflush(nullptr); // else the child would write what is buffered once more
    const pid_t child = fork();
    if (child < 0)
        throw std::runtime_error("no process");
    if (child == 0) {
        inChild();
        execute(words, environment, device.empty() ? folder / "output" : device, folder / "errors");
    }
    meanwhile(child);
    int status = 0;
    if (waitpid(child, &status, 0) != child)
        throw std::runtime_error("the process was lost");
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, WIFSIGNALED(status) ? WTERMSIG(status) : 0,
            textOf(folder / "output"), textOf(folder / "errors")};
}

template <typename InChild, typename Meanwhile>
Outcome run(const std::vector<std::string> &arguments,
            const std::vector<std::pair<std::string, std::string>> &environment, InChild &&inChild,
            Meanwhile &&meanwhile, const std::filesystem::path &device = {})
{
    std::vector<std::string> words = {VELLUM_COMMAND};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return runWords(words, environment, inChild, meanwhile, device);
}

} // namespace

Outcome runVellum(const std::vector<std::string> &arguments,
                  const std::vector<std::pair<std::string, std::string>> &environment,
                  const std::filesystem::path &input)
{
    return run(
        arguments, environment,
        [&] {
            if (std::freopen(input.c_str(), "r", stdin) == nullptr)
                _exit(127);
        },
        [](pid_t) {});
}

Outcome interruptVellum(const std::vector<std::string> &arguments, int signal, const std::filesystem::path &begun,
                        const std::vector<std::pair<std::string, std::string>> &environment)
{
    return run(
        arguments, environment, [] {},
        [&](pid_t child) {
            siginfo_t ended{};
            while (!std::filesystem::exists(begun) && ended.si_pid == 0) {
                std::this_thread::sleep_for(std::chrono::milliseconds(10));
                waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT);
            }
            kill(child, signal);
        });
}

Outcome runVellumWithOpenFiles(const std::vector<std::string> &arguments, unsigned long count)
{
    return run(
        arguments, {},
        [&] {
            const rlimit limit{count, count};
            setrlimit(RLIMIT_NOFILE, &limit);
        },
        [](pid_t) {});
}

std::optional<Outcome> interruptVellumAtCall(const std::vector<std::string> &arguments, int signal, int call,
                                             const std::string &preloaded)
{
    bool stopped = false;
    Outcome outcome = run(
        arguments, {{"LD_PRELOAD", preloaded}, {"VELLUM_STOPPED_CALL", std::to_string(call)}}, [] {},
        [&](pid_t child) {
            siginfo_t state{};
            stopped = waitid(P_PID, static_cast<id_t>(child), &state, WSTOPPED | WEXITED | WNOWAIT) == 0 &&
                      state.si_code == CLD_STOPPED;
            if (!stopped)
                return;
            kill(child, signal);
            kill(child, SIGCONT);
        });
    return stopped ? std::optional(std::move(outcome)) : std::nullopt;
}

Outcome runVellumWithoutThreads(const std::vector<std::string> &arguments)
{
    return run(
        arguments, {},
        [] {
            // New threads get a stack of that size, which is more than there are addresses.
            const rlimit limit{rlim_t{1} << 47, RLIM_INFINITY};
            setrlimit(RLIMIT_STACK, &limit);
        },
        [](pid_t) {});
}

Outcome runVellumWithFileLimit(const std::vector<std::string> &arguments, unsigned long bytes)
{
    return run(
        arguments, {},
        [&] {
            const rlimit limit{bytes, bytes};
            setrlimit(RLIMIT_FSIZE, &limit);
        },
        [](pid_t) {});
}

Outcome runVellumInTerminal(const std::vector<std::string> &arguments)
{
    const int terminal = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0)
        throw std::runtime_error("no terminal");
    std::string output;
    Outcome outcome = run(
        arguments, {}, [] {},
        [&](pid_t) {
            char bytes[4096];
            // Waits until the child has opened the terminal; fails once no process has it open.
            for (ssize_t count = 1; count > 0; output.append(bytes, static_cast<size_t>(std::max<ssize_t>(count, 0))))
                count = read(terminal, bytes, sizeof bytes);
        },
        ptsname(terminal));
    close(terminal);
    outcome.output = output;
    return outcome;
}

Outcome runVellumInScript(const std::string &script, const std::vector<std::string> &arguments)
{
    std::vector<std::string> words = {"/bin/sh", "-c", script, "sh", VELLUM_COMMAND};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return runWords(
        words, {}, [] {}, [](pid_t) {});
}

Outcome runVellumToFullDevice(const std::vector<std::string> &arguments)
{
    return run(
        arguments, {}, [] {}, [](pid_t) {}, "/dev/full");
}

} // namespace vellum::test
