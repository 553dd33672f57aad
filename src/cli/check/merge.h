// SPDX-License-Identifier: Apache-2.0
// The results of several runs, such as the shards of one, as those of one run.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/check/results.h"

namespace vellum::cli
{

struct MergedRuns {
    RunFacts facts;
    std::vector<CaseResult> results;
    std::string incomplete; // what is missing; empty if nothing is
};

// Reads the folders of runs, or their results.json. Throws UsageError for other files, and for runs that do not belong
// together: of other devices, seeds or divisions, or with the same case.
MergedRuns mergeRuns(const std::vector<std::filesystem::path> &runs);
// Copies the files of their failures to the folder. Throws Error.
void copyFailures(MergedRuns &runs, const OutputFolder &folder);

} // namespace vellum::cli
