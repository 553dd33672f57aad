// SPDX-License-Identifier: Apache-2.0
// Results in the formats of other programs, and as JSON.
#pragma once

#include <string>
#include <vector>

#include "cli/check/protocol.h"
#include "cli/check/results.h"

namespace vellum::cli
{

// What is known about a run as a whole.
struct RunFacts {
    DeviceSummary device;
    uint64_t seed = 0;
    std::vector<PlannedGroup> plan;
    double seconds = 0;
    bool interrupted = false;
};

// deqp-runner's results.csv: name,status,seconds, by name.
std::string resultsCsv(const std::vector<CaseResult> &results);
// deqp-runner's failures.csv: name,status of what is no success. It can be the next run's baseline.
std::string failuresCsv(const std::vector<CaseResult> &results);
// JUnit's XML, a test suite for each group and extension.
std::string junitXml(const RunFacts &facts, const std::vector<CaseResult> &results);
// src/cli/schema.json describes it.
std::string resultsJson(const RunFacts &facts, const std::vector<CaseResult> &results);

// For people: a table of groups and a list of causes.
std::string resultsTable(const RunFacts &facts, const std::vector<CaseResult> &results);

} // namespace vellum::cli
