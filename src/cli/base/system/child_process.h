// SPDX-License-Identifier: Apache-2.0
// Processes that the command starts.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum::cli
{

struct ProcessEnd {
    int code = 0;      // the exit code
    std::string crash; // what ended the process instead, such as "SIGSEGV"; empty where it exited

    // "SIGSEGV", "exit code 1"; empty for success.
    [[nodiscard]] std::string text() const
    {
        return !crash.empty() ? crash : code == 0 ? std::string() : "exit code " + std::to_string(code);
    }
};

// This program once more, with pipes for its standard streams and without the terminal's Ctrl-C.
class ChildProcess
{
public:
    // `arguments`: those after the program's name. Throws Error.
    explicit ChildProcess(const std::vector<std::string> &arguments);
    // Kills it if it still runs.
    ~ChildProcess();
    ChildProcess(const ChildProcess &) = delete;
    ChildProcess &operator=(const ChildProcess &) = delete;

    // To its stdin: at most what a pipe holds. A process that has ended shows it by end().
    void write(std::string_view text);
    void closeInput();
    // With all processes that it started.
    void kill();

    // Nothing while it runs. What it has written before can still be read.
    [[nodiscard]] std::optional<ProcessEnd> end() const;
    // Appends what has come from its stdout and from its stderr.
    void read(std::string &output, std::string &errors);
    // Seconds for which its threads, together, were ready and had to wait for a processor. Linux; elsewhere 0.
    [[nodiscard]] double waitedForProcessor() const;
    // Waits until one of them has written something or has ended, or for some milliseconds.
    static void waitForAny(std::span<const ChildProcess *const> processes, int milliseconds);

private:
    struct System;
    std::unique_ptr<System> system_;
};

// In a ChildProcess: it ends when the process ends that started it.
void endWithParent();

// Runs a program with the streams, the environment and the terminal of this process, and waits for its end. `words`:
// its name, looked up in PATH, and its arguments. Signals that are sent to this process alone are passed on. Returns
// the program's exit code as shells of this system have it (kExitCodesOfPrograms); 127 where there is no such program
// and 126 where it cannot be executed, after a line on stderr.
int runProgram(std::span<const std::string> words);
// A line for the help.
extern const char *const kExitCodesOfPrograms;

} // namespace vellum::cli
