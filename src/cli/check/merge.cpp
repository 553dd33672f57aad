// SPDX-License-Identifier: Apache-2.0
#include "cli/check/merge.h"

#include <algorithm>
#include <exception>
#include <map>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/json_reader.h"
#include "cli/base/files.h"
#include "core/utf8_path.h"
#include "job/shard.h"

namespace vellum::cli
{
namespace
{

struct Run {
    std::filesystem::path folder;
    RunFacts facts;
    std::optional<job::Shard> shard;
    std::vector<CaseResult> results;
};

double numberOf(const rapidjson::Value &object, const char *name)
{
    const auto member = object.FindMember(name);
    if (member == object.MemberEnd() || !member->value.IsNumber())
        throw Error(std::string("no number \"") + name + "\"");
    return member->value.GetDouble();
}

CaseResult caseOf(const rapidjson::Value &object, const std::filesystem::path &folder)
{
    const std::string name = JsonReader::textOf(object, "case");
    const std::optional<CaseId> id = parseCase(name);
    const std::optional<Verdict> verdict = parseVerdict(JsonReader::textOf(object, "result"));
    if (!id || !verdict)
        throw Error("no case and result of this version: " + name);
    CaseResult result{.id = *id,
                      .status = parseStatus(JsonReader::textOf(object, "status")),
                      .verdict = *verdict,
                      .seconds = numberOf(object, "seconds"),
                      .rays = static_cast<uint64_t>(numberOf(object, "rays"))};
    CaseResult::Details details{JsonReader::textOr(object, "cause"), JsonReader::textOr(object, "detail"), {}};
    if (result.status == check::Status::Pass && details.cause.empty())
        return result;
    if (const std::filesystem::path file = OutputFolder::reproducerIn(folder, *id); std::filesystem::exists(file))
        details.reproducer = utf8Text(file);
    result.details = std::make_shared<CaseResult::Details>(std::move(details));
    return result;
}

Run readRun(const std::filesystem::path &path)
{
    const std::filesystem::path file = resultsOf(path);
    try {
        const JsonReader json(readFile(file));
        if (json.text("command") != "check")
            throw Error("it is of vellum " + json.text("command"));
        Run run;
        run.folder = file.parent_path();
        run.facts.version = json.text("version");
        run.facts.device.name = json.text("device");
        run.facts.device.implementation = json.text("implementation");
        run.facts.seed = std::stoull(json.text("seed"));
        run.facts.seconds = std::stod(json.json("seconds"));
        run.facts.selection = json.text("selection");
        run.facts.replayOptions = json.textOr("replayOptions");
        run.facts.incomplete = json.textOr("incomplete");
        if (const std::string shard = json.textOr("shard"); !shard.empty())
            run.shard = job::parseShard(shard);
        json.forEach("knownFaults", [&](const rapidjson::Value &fault) {
            run.facts.device.knownFaults.push_back(
                {JsonReader::textOf(fault, "fault"), JsonReader::textOf(fault, "response")});
        });
        json.forEach("groups", [&](const rapidjson::Value &group) {
            const std::string name = JsonReader::textOf(group, "api") + "." + JsonReader::textOf(group, "group");
            const std::optional<CaseId> first = parseCase(name + ".0000");
            if (!first)
                throw Error("no group of this version: " + name);
            run.facts.plan.push_back({first->api, first->group, static_cast<size_t>(numberOf(group, "planned"))});
        });
        json.forEach("cases",
                     [&](const rapidjson::Value &object) { run.results.push_back(caseOf(object, run.folder)); });
        return run;
    } catch (const std::exception &wrong) {
        throw UsageError(utf8Text(file) + " has no results of vellum check: " + wrong.what());
    }
}

void checkBelong(const Run &run, const Run &first)
{
    const auto differ = [&](const char *what, const std::string &one, const std::string &other) {
        if (one != other)
            throw UsageError(utf8Text(run.folder) + " and " + utf8Text(first.folder) + " are of different " + what +
                             ": " + one + " and " + other);
    };
    const auto division = [](const Run &of) {
        return of.shard ? "--shard K/" + std::to_string(of.shard->count) : std::string("without --shard");
    };
    differ("versions", run.facts.version, first.facts.version);
    differ("devices", run.facts.device.name, first.facts.device.name);
    differ("implementations", run.facts.device.implementation, first.facts.device.implementation);
    differ("seeds", std::to_string(run.facts.seed), std::to_string(first.facts.seed));
    differ("selections", run.facts.selection, first.facts.selection);
    differ("divisions", division(run), division(first));
}

void addPlan(const std::vector<PlannedGroup> &more, std::vector<PlannedGroup> &plan)
{
    for (const PlannedGroup &group : more) {
        const auto same = std::ranges::find_if(
            plan, [&](const PlannedGroup &known) { return known.api == group.api && known.group == group.group; });
        if (same == plan.end())
            plan.push_back(group);
        else
            same->cases += group.cases;
    }
}

// "shards 2, 5 of 8 are missing"
std::string missingShards(const std::vector<Run> &runs)
{
    if (!runs.front().shard)
        return {};
    const uint32_t count = runs.front().shard->count;
    std::set<uint32_t> present;
    for (const Run &run : runs)
        present.insert(run.shard->number);
    std::string missing;
    for (uint32_t number = 1; number <= count; ++number)
        if (!present.contains(number))
            missing += (missing.empty() ? "" : ", ") + std::to_string(number);
    return missing.empty() ? std::string() : "of " + std::to_string(count) + " shards these are missing: " + missing;
}

} // namespace

std::filesystem::path resultsOf(const std::filesystem::path &run)
{
    std::error_code error;
    return std::filesystem::is_directory(run, error) ? run / kResultsFile : run;
}

std::string incompleteIn(const std::filesystem::path &folder)
{
    try {
        return JsonReader(readFile(folder / kResultsFile)).textOr("incomplete");
    } catch (const std::exception &) { // no file, or not one of this command
        return {};
    }
}

MergedRuns mergeRuns(const std::vector<std::filesystem::path> &paths)
{
    std::vector<Run> runs;
    for (const std::filesystem::path &path : paths)
        runs.push_back(readRun(path));
    MergedRuns merged;
    merged.facts = runs.front().facts;
    merged.facts.plan.clear();
    std::string &incomplete = merged.facts.incomplete;
    const auto addIncomplete = [&](const std::string &why) { incomplete += (incomplete.empty() ? "" : "; ") + why; };
    incomplete.clear();
    merged.facts.seconds = 0;
    std::map<std::string, const Run *> cases;
    for (const Run &run : runs) {
        checkBelong(run, runs.front());
        addPlan(run.facts.plan, merged.facts.plan);
        merged.facts.seconds += run.facts.seconds;
        if (!run.facts.incomplete.empty())
            addIncomplete(utf8Text(run.folder) + ": " + run.facts.incomplete);
        for (const CaseResult &result : run.results) {
            const std::string name = nameOf(result.id);
            const auto [known, added] = cases.emplace(name, &run);
            if (!added)
                throw UsageError(utf8Text(run.folder) + " and " + utf8Text(known->second->folder) +
                                 " have the same case, " + name);
            merged.results.push_back(result);
        }
    }
    if (const std::string missing = missingShards(runs); !missing.empty())
        addIncomplete(missing);
    return merged;
}

void copyFailures(MergedRuns &runs, const OutputFolder &folder)
{
    for (CaseResult &result : runs.results)
        if (result.details && !result.details->reproducer.empty()) {
            CaseResult::Details details = *result.details;
            details.reproducer = folder.copyFailure(utf8Path(details.reproducer).parent_path(), result.id);
            result.details = std::make_shared<CaseResult::Details>(std::move(details));
        }
}

} // namespace vellum::cli
