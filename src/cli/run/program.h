// SPDX-License-Identifier: Apache-2.0
// A program that runs as a child of the command.
#pragma once

#include <span>
#include <string>

namespace vellum::cli
{

// Runs it with the environment of this process, and waits for its end. `words`: its name, looked up in PATH, and its
// arguments. Signals that are sent to this process alone are passed on. Returns an exit code as shells have it: the
// program's own; 128 + n where signal n ended it; 127 where there is no such program and 126 where it cannot be
// executed, after a line on stderr.
int runProgram(std::span<const std::string> words);

} // namespace vellum::cli
