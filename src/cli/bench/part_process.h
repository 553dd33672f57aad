// SPDX-License-Identifier: Apache-2.0
// A part of `vellum bench` in a process of its own.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/bench/part.h"

namespace vellum::cli
{

struct PartResult {
    Part part;
    std::vector<std::string> rows; // JSON objects, all that were complete
    std::string failure;           // how it ended, in words; empty for success
    double seconds = 0;
};

// Runs `vellum bench --part`, and ends it if no row comes for `timeout` seconds, or for twice as long as rows of this
// part are to take, or if this process is interrupted. `progress` is called now and then. Throws Error if no process
// can be started.
PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress);

} // namespace vellum::cli
