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

// Runs `vellum bench --part` and waits, at most until three times the seconds that the part should take and some more
// for starting. `seen`: called with each row, and now and then with an empty one. Throws Error if no process can be
// started.
PartResult runPartProcess(const Part &part, const BenchDevice &device,
                          const std::function<void(const std::string &row)> &seen);

} // namespace vellum::cli
