// SPDX-License-Identifier: Apache-2.0
// Runs the `vellum` command as its user does.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vellum::test
{

struct Outcome {
    int exitCode = -1; // -1: ended by a signal
    int signal = 0;    // the signal's number
    std::string output;
    std::string errors;

    // Number of lines on stderr; an unfinished one counts.
    [[nodiscard]] int errorLines() const;
};

bool has(const std::string &text, const std::string &part);

// The first line of the output with this beginning; empty if there is none.
std::string lineOf(const Outcome &outcome, const std::string &beginning);

// Runs it with these arguments, and these variables added to the environment.
// stdin is that file.
Outcome runVellum(const std::vector<std::string> &arguments,
                  const std::vector<std::pair<std::string, std::string>> &environment = {},
                  const std::filesystem::path &input = "/dev/null");

#ifndef _WIN32
// Sends it a signal at the call of this number of those that change files (stopped_call.cpp, which is `preloaded`).
// Nothing if it makes fewer calls, and so ends by itself.
std::optional<Outcome> interruptVellumAtCall(const std::vector<std::string> &arguments, int signal, int call,
                                             const std::string &preloaded);

// Runs it where no thread can be started.
Outcome runVellumWithoutThreads(const std::vector<std::string> &arguments);

// Sends it a signal as soon as there is such a file or folder.
Outcome interruptVellum(const std::vector<std::string> &arguments, int signal, const std::filesystem::path &begun,
                        const std::vector<std::pair<std::string, std::string>> &environment = {});

// Runs it with this limit on open files.
Outcome runVellumWithOpenFiles(const std::vector<std::string> &arguments, unsigned long count);

// Runs it with a limit on the size of each file that it writes.
Outcome runVellumWithFileLimit(const std::vector<std::string> &arguments, unsigned long bytes);

// Runs a script of the shell, in which "$@" is the command with these arguments.
Outcome runVellumInScript(const std::string &script, const std::vector<std::string> &arguments);

// Runs it with a stdout that cannot be written: /dev/full.
Outcome runVellumToFullDevice(const std::vector<std::string> &arguments);

// Runs it with a terminal as stdout.
Outcome runVellumInTerminal(const std::vector<std::string> &arguments);
#endif

} // namespace vellum::test
