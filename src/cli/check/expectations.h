// SPDX-License-Identifier: Apache-2.0
// The expected results of cases, in the files of deqp-runner: a baseline of known failures, skips and flakes.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "check/groups/group.h"

namespace vellum::cli
{

const char *nameOf(check::Status status);

// The statuses of deqp-runner, in which a lost device is a crash.
enum class Verdict {
    Pass,
    Fail,
    Skip,
    Crash,
    Timeout,
    Missing, // not run: no device could be opened any more, or no worker be started
    Flake,   // failed, and passed when it was run again
    KnownFlake,
    ExpectedFail,
    ImprovedToPass, // "UnexpectedImprovement(Pass)": the baseline has a failure
    ImprovedToFail, // the baseline has a crash or a timeout
    ImprovedToSkip,
};
// The name in results.csv.
const char *nameOf(Verdict verdict);
// Nothing for another text.
std::optional<Verdict> parseVerdict(const std::string &text);
// Nothing for another text.
std::optional<check::Status> parseStatus(const std::string &text);
bool isSuccess(Verdict verdict);
// `failOnFlake`: with --fail-on-flake.
bool failsRun(Verdict verdict, bool failOnFlake);
// Better than the baseline. No success: the baseline is to be updated.
bool isImprovement(Verdict verdict);

class Expectations
{
public:
    // `endless`: for a run with cases after those of a full run.
    explicit Expectations(bool endless = false) : endless_(endless) {}
    // Adds the results of a file such as failures.csv: name,status[,duration]. Throws UsageError, also for a name of no
    // case.
    void addBaseline(const std::filesystem::path &path);
    // Add regular expressions, one a line, which match a part of a name. Throw UsageError, also for one that matches no
    // case.
    void addSkips(const std::filesystem::path &path) { addExpressions(path, skips_); }
    void addFlakes(const std::filesystem::path &path) { addExpressions(path, flakes_); }

    [[nodiscard]] bool skips(const std::string &name) const { return matches(name, skips_); }
    [[nodiscard]] Verdict verdictOn(const std::string &name, check::Status status) const;

private:
    using Expressions = std::vector<std::regex>;
    void addExpressions(const std::filesystem::path &path, Expressions &expressions) const;
    static bool matches(const std::string &name, const Expressions &expressions);

    bool endless_;
    std::map<std::string, Verdict, std::less<>> baseline_;
    Expressions skips_;
    Expressions flakes_;
};

// The lines of a file without comments (#), spaces at their ends and empty lines; calls use(line, "FILE:NUMBER").
// Throws UsageError where the file cannot be read.
void forEachLine(const std::filesystem::path &path,
                 const std::function<void(const std::string &line, const std::string &place)> &use);

} // namespace vellum::cli
