// `vellum bake`
#pragma once

#include "cli/bake_options.h"

namespace vellum::cli
{

struct BakeJob {
    std::filesystem::path input;
    std::filesystem::path output;
};

// What to bake, and where to. Throws Error where that is unclear or two would be written to one place.
std::vector<BakeJob> planBake(const BakeCommandOptions &options);

// Bakes all files and prints what was done. Returns the exit code.
int bakeCommand(const BakeCommandOptions &options);

} // namespace vellum::cli
