// SPDX-License-Identifier: Apache-2.0
// This process, its signals and environment, and processes that it starts. All texts are UTF-8.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum
{

// Must be called first in main. Returns the arguments, without the program's name.
std::vector<std::string> prepareProcess(int argc, char **argv);

// The path of the program's file. Empty if it is not known.
std::filesystem::path programPath();

// Returns whether Vulkan's loader and the layer ignore the environment and what is registered for the user, in this
// process and in those that it starts: if it has more rights than its user's programs usually have.
bool environmentIsIgnored();

// The value of a variable of the environment.
std::optional<std::string> variable(const char *name);
void setVariable(const char *name, const std::string &value);
// The names of all variables.
std::vector<std::string> variableNames();
// Separates the parts of a variable that is a list.
#ifdef _WIN32
inline constexpr char kListSeparator = ';';
#else
inline constexpr char kListSeparator = ':';
#endif
struct ProcessEnd {
    int code = 0;      // the exit code
    std::string crash; // the reason if it did not exit, such as "SIGSEGV"; empty if it exited

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

    // Writes to its stdin, and waits where its pipe is full: it must read. end() shows that a process has ended.
    void write(std::string_view text);
    void closeInput();
    // Kills it and all processes that it started.
    void kill();

    // Nothing while it runs. Its earlier output can still be read.
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

// Called in a ChildProcess: makes it end when its parent ends.
void endWithParent();

// How a program ended that was run.
struct ProgramEnd {
    static constexpr int kTimedOut = 124;      // as timeout(1) exits
    static constexpr int kNotExecutable = 126; // as shells exit
    static constexpr int kNoProgram = 127;

    bool started = true;
    bool timedOut = false;
    int code = 0;       // by the convention of shells of this system (kExitCodesOfPrograms), or one of these
    std::string signal; // "SIGSEGV", if one ended it; of Windows, the exception
    std::string text;   // "exited with 3", "ended by signal 11 (SIGSEGV)"; why it did not start
};

// Runs a program with the streams, the environment and the terminal of this process, and waits for its end. `words`:
// its name, looked up in PATH, and its arguments. Signals that are sent to this process alone are passed on.
// `seconds`: it runs in a process group of its own (Windows: a job), which is ended after these.
ProgramEnd runProgram(std::span<const std::string> words, std::optional<double> seconds);
// A line for the help.
extern const char *const kExitCodesOfPrograms;

// While there is one, SIGINT, SIGTERM and SIGHUP are only remembered; the second of a kind ends the process as ever. A
// write to a file that may not grow further fails instead of ending the process (SIGXFSZ).
class Interruptible
{
public:
    Interruptible();
    ~Interruptible();
    Interruptible(const Interruptible &) = delete;
    Interruptible &operator=(const Interruptible &) = delete;

    // May be called from any thread.
    static bool interrupted();
    // Ends the process by the signal that came, as its parent expects.
    [[noreturn]] static void die();
};

} // namespace vellum
