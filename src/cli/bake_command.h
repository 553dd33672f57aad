// `vellum bake`
#pragma once

#include "cli/bake_options.h"

namespace vellum::cli
{

struct BakeJob {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string refusal; // why it cannot be baked beside the others; empty where it can
};

// What to bake, and where to. Throws Error where that is unclear or two would be written to one place. A job that would
// write over what another one reads, or write another file where one before it does, gets a refusal.
std::vector<BakeJob> planBake(const BakeCommandOptions &options);

// Bakes all files and prints what was done. Returns the exit code.
int bakeCommand(const BakeCommandOptions &options);

} // namespace vellum::cli
