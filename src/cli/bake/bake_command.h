// SPDX-License-Identifier: Apache-2.0
// `vellum bake`
#pragma once

#include "cli/bake/bake_options.h"

namespace vellum::cli
{

struct BakeJob {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string problem; // why it cannot be baked; empty if it can
};

// What to bake, and where to. Throws UsageError if that is unclear or two outputs are the same file. A job gets a
// problem if it would replace a file that another one reads or writes, or one that vellum did not write.
std::vector<BakeJob> planBake(const BakeCommandOptions &options);

// Bakes all files and prints the report. Returns the exit code.
int bakeCommand(BakeCommandOptions &options);

} // namespace vellum::cli
