// SPDX-License-Identifier: Apache-2.0
// Cases in worker processes that they may end.
#pragma once

#include <memory>

#include "cli/check/worker_process.h"

namespace vellum::cli
{

class SeparateRuns
{
public:
    SeparateRuns(WorkerOptions options, double timeout) : options_(std::move(options)), timeout_(timeout) {}

    // The case of a group as a reproducer; it does not run. Throws Error.
    std::string make(const std::string &group, uint64_t seed);
    // Runs one. Another process follows one that has ended.
    check::Outcome run(const std::string &reproducer);

private:
    check::Outcome outcomeOf(const Request &request);

    WorkerOptions options_;
    double timeout_;
    std::unique_ptr<WorkerProcess> process_;
};

} // namespace vellum::cli
