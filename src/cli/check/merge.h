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
};

// The results of a run, which is given by its folder or by this file.
std::filesystem::path resultsOf(const std::filesystem::path &run);
// Why the results in a folder are not whole, "interrupted"; empty if they are, or are not there.
std::string incompleteIn(const std::filesystem::path &folder);
// Throws UsageError for other files, and for runs that do not belong together: of other versions of Vellum, devices,
// seeds, selections or divisions, or with the same case.
MergedRuns mergeRuns(const std::vector<std::filesystem::path> &runs);
// Copies the files of their failures to the folder. Throws Error.
void copyFailures(MergedRuns &runs, const OutputFolder &folder);

} // namespace vellum::cli
