// SPDX-License-Identifier: Apache-2.0
// `vellum bench`
#pragma once

#include "cli/bench/part.h"

namespace vellum::cli
{

struct BenchOptions {
    std::optional<std::filesystem::path> output; // the page; the JSON is in the same folder
    BenchDevice device;
    double seconds = 180; // of all parts together
    double timeout = 60;  // without progress, after which a part counts as hung
    bool force = false;   // replaces any file
    std::string worker;   // a process of another one: its part, for who reads lists of processes
};

// Measures, prints the verdict on stdout, and writes the report. Returns the exit code.
int benchCommand(const BenchOptions &options);

} // namespace vellum::cli
