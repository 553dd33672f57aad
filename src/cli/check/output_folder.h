// SPDX-License-Identifier: Apache-2.0
// The folder that results and reproducers are written to.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "cli/check/formats.h"
#include "cli/check/runner.h"

namespace vellum::cli
{

class OutputFolder
{
public:
    // Throws Error for a folder with files that are not of an earlier run, unless `force` is set.
    OutputFolder(std::filesystem::path path, bool force);

    // Writes the reproducer of a failure and what explains it, for the first failures with each cause. Returns its
    // path; empty if there is none.
    std::string writeFailure(const Finished &finished, uint64_t seed);
    // Writes results.csv, failures.csv, junit.xml and results.json. Throws Error.
    void writeResults(const RunFacts &facts, const std::vector<CaseResult> &results) const;

private:
    static constexpr size_t kMostReproducers = 3;
    static constexpr size_t kMostReproducerBytes = 65000; // of a case

    std::filesystem::path path_;
    std::map<std::string, size_t> written_; // reproducers, by cause
};

// The file appears whole. Throws Error.
void writeText(const std::filesystem::path &path, const std::string &text);

} // namespace vellum::cli
