// SPDX-License-Identifier: Apache-2.0
// Standard streams and terminals.
#pragma once

#include <cstddef>
#include <cstdio>
#include <optional>

namespace vellum::cli
{

bool isTerminal(std::FILE *stream);
// Columns of the terminal that stdout is; nothing where it is none.
std::optional<size_t> terminalWidth();

// Another stream to where stdout leads, which no child process inherits. Null if it cannot be made.
std::FILE *duplicateStdout();
// What is printed to stdout goes to stderr from now on. False if that is not possible.
bool sendStdoutToStderr();
// What is printed to stdout is discarded from now on. False if that is not possible.
bool discardStdout();

} // namespace vellum::cli
