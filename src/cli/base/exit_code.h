// SPDX-License-Identifier: Apache-2.0
// The exit codes of all subcommands.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vellum::cli
{

// If several apply to one run, it exits with the smallest that is not 0.
enum class ExitCode : int {
    Success = 0,
    Failed = 1,
    Usage = 2,
    InvalidMicromaps = 3,
    WrongClaims = 4,
    UncertainClaims = 5, // 5 and 6 only with verify --strict
    NeedlesslyUnknown = 6,
    NoMicromaps = 7, // verify --strict or --require-micromaps, bake --require-micromaps
    // Far from those of the programs that `run` runs; 126 and more are a shell's.
    MessagesFailed = 122, // run
    TimedOut = 124,       // run --timeout
    NotRun = 125,         // run, check
    NotExecutable = 126,  // run
    NoProgram = 127,      // run
    Interrupted = 130,    // 128 + SIGINT: the process ends by the signal
};

// Codes and their meanings, as "4" and "states that contradict the texture", in order: those that a subcommand can
// return, or all, with the subcommands and options before the texts, if it is empty.
std::vector<std::pair<std::string, std::string>> exitCodesOf(std::string_view subcommand);

// The code of a run in which both happened.
ExitCode worse(ExitCode a, ExitCode b);

} // namespace vellum::cli
