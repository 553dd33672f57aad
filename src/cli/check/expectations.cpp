// SPDX-License-Identifier: Apache-2.0
#include "cli/check/expectations.h"

#include <algorithm>
#include <fstream>
#include <utility>

#include "base/error.h"
#include "cli/check/cases.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

constexpr std::pair<Verdict, const char *> kVerdicts[] = {
    {Verdict::Pass, "Pass"},
    {Verdict::Fail, "Fail"},
    {Verdict::Skip, "Skip"},
    {Verdict::Crash, "Crash"},
    {Verdict::Timeout, "Timeout"},
    {Verdict::Missing, "Missing"},
    {Verdict::Flake, "Flake"},
    {Verdict::KnownFlake, "KnownFlake"},
    {Verdict::ExpectedFail, "ExpectedFail"},
    {Verdict::ImprovedToPass, "UnexpectedImprovement(Pass)"},
    {Verdict::ImprovedToFail, "UnexpectedImprovement(Fail)"},
    {Verdict::ImprovedToSkip, "UnexpectedImprovement(Skip)"},
};

// deqp-runner's rules. In a baseline, what failed better than an earlier one is a failure.
Verdict compare(Verdict verdict, Verdict baseline)
{
    if (baseline == Verdict::ImprovedToFail)
        baseline = Verdict::Fail;
    const bool failed = baseline == Verdict::Fail || baseline == Verdict::Crash || baseline == Verdict::Timeout ||
                        baseline == Verdict::Missing;
    switch (verdict) {
    case Verdict::Pass: return failed ? Verdict::ImprovedToPass : verdict;
    case Verdict::Skip: return failed ? Verdict::ImprovedToSkip : verdict;
    case Verdict::Fail:
        if (baseline == Verdict::Crash || baseline == Verdict::Timeout)
            return Verdict::ImprovedToFail;
        return baseline == Verdict::Fail || baseline == Verdict::ExpectedFail ? Verdict::ExpectedFail : verdict;
    case Verdict::Crash:
        return baseline == Verdict::Crash || baseline == Verdict::ExpectedFail ? Verdict::ExpectedFail : verdict;
    case Verdict::Timeout: return baseline == Verdict::Timeout ? Verdict::ExpectedFail : verdict;
    default: return verdict;
    }
}

Verdict verdictOf(check::Status status)
{
    switch (status) {
    case check::Status::Pass: return Verdict::Pass;
    case check::Status::Fail: return Verdict::Fail;
    case check::Status::Skip: return Verdict::Skip;
    case check::Status::Timeout: return Verdict::Timeout;
    case check::Status::Crash:
    case check::Status::DeviceLost: break;
    }
    return Verdict::Crash;
}

} // namespace

std::optional<Verdict> parseVerdict(const std::string &text)
{
    // deqp-runner has these too, but no case here does.
    if (text == "Warn" || text == "UnexpectedImprovement(Warn)")
        return Verdict::Pass;
    const auto *const found =
        std::find_if(std::begin(kVerdicts), std::end(kVerdicts), [&](const auto &v) { return text == v.second; });
    return found != std::end(kVerdicts) ? std::optional(found->first) : std::nullopt;
}

std::optional<check::Status> parseStatus(const std::string &text)
{
    using enum check::Status;
    for (const check::Status status : {Pass, Fail, Skip, Crash, Timeout, DeviceLost})
        if (text == nameOf(status))
            return status;
    return std::nullopt;
}

const char *nameOf(check::Status status)
{
    return status == check::Status::DeviceLost ? "DeviceLost" : nameOf(verdictOf(status));
}

const char *nameOf(Verdict verdict)
{
    return std::find_if(std::begin(kVerdicts), std::end(kVerdicts), [&](const auto &v) { return verdict == v.first; })
        ->second;
}

bool isSuccess(Verdict verdict)
{
    switch (verdict) {
    case Verdict::Pass:
    case Verdict::Skip:
    case Verdict::Flake:
    case Verdict::KnownFlake:
    case Verdict::ExpectedFail: return true;
    default: return false;
    }
}

bool failsRun(Verdict verdict, bool failOnFlake)
{
    return !isSuccess(verdict) || (failOnFlake && verdict == Verdict::Flake);
}

bool isImprovement(Verdict verdict)
{
    return verdict == Verdict::ImprovedToPass || verdict == Verdict::ImprovedToFail ||
           verdict == Verdict::ImprovedToSkip;
}

void forEachLine(const std::filesystem::path &path,
                 const std::function<void(const std::string &line, const std::string &place)> &use)
{
    std::ifstream file(path);
    std::string line;
    for (size_t number = 1; std::getline(file, line); ++number) {
        line.erase(line.find_last_not_of(" \t\r") + 1);
        if (!line.empty() && line.front() != '#')
            use(line, utf8Text(path) + ":" + std::to_string(number));
    }
    if (!file.eof())
        throw UsageError(utf8Text(path) + " cannot be read");
}

void Expectations::addBaseline(const std::filesystem::path &path)
{
    forEachLine(path, [this](const std::string &line, const std::string &place) {
        const size_t comma = line.find(',');
        const std::string rest = comma == std::string::npos ? "" : line.substr(comma + 1);
        const std::optional<Verdict> verdict = parseVerdict(rest.substr(0, rest.find(',')));
        if (!verdict || comma == 0)
            throw UsageError(place + ": must be NAME,STATUS with a status of deqp-runner, got " + line);
        const std::optional<CaseId> id = parseCase(line.substr(0, comma));
        if (!id || (!endless_ && id->number >= id->group->cases))
            throw UsageError(place + ": there is no case " + line.substr(0, comma) +
                             "; vellum check --list prints them");
        if (!baseline_.emplace(line.substr(0, comma), *verdict).second)
            throw UsageError(place + ": " + line.substr(0, comma) + " has two results");
    });
}

void Expectations::addExpressions(const std::filesystem::path &path, Expressions &expressions) const
{
    forEachLine(path, [&](const std::string &line, const std::string &place) {
        const size_t comma = line.rfind(',');
        if (comma != std::string::npos && parseVerdict(line.substr(comma + 1)))
            throw UsageError(place + ": must be a regular expression without a status, got " + line);
        try {
            expressions.emplace_back(line);
        } catch (const std::regex_error &) {
            throw UsageError(place + ": must be a regular expression, got " + line);
        }
        if (!anyCase([&](const std::string &name) { return std::regex_search(name, expressions.back()); }, endless_))
            throw UsageError(place + ": matches no case: " + line);
    });
}

bool Expectations::matches(const std::string &name, const Expressions &expressions)
{
    return std::any_of(expressions.begin(), expressions.end(),
                       [&](const std::regex &expression) { return std::regex_search(name, expression); });
}

Verdict Expectations::verdictOn(const std::string &name, check::Status status) const
{
    const auto baseline = baseline_.find(name);
    const Verdict verdict = verdictOf(status);
    const Verdict compared = baseline == baseline_.end() ? verdict : compare(verdict, baseline->second);
    return !isSuccess(compared) && matches(name, flakes_) ? Verdict::KnownFlake : compared;
}

} // namespace vellum::cli
