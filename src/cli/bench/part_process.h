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
    double others = 0; // the share of the processors that other programs took before it and after it
};

// Runs `vellum bench --part`, and ends it if it reports neither a row nor progress for `timeout` seconds, or if this
// process is interrupted. `progress` is called now and then.
PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress);

} // namespace vellum::cli
