// SPDX-License-Identifier: Apache-2.0
#include "cli/check/results.h"

#include <exception>
#include <fmt/format.h>
#include <optional>
#include <set>
#include <tuple>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "base/text.h"
#include "cli/base/files.h"
#include "core/utf8_path.h"
#include "inspect/report_parts.h"
#include "job/shard.h"

namespace vellum::cli
{
namespace
{

// In the order of --list.
bool isBefore(const CaseId &a, const CaseId &b)
{
    return a.api != b.api ? a.api == check::Api::Khr : std::tie(a.group, a.number) < std::tie(b.group, b.number);
}

void add(const CaseResult &result, std::vector<CauseTally> &causes)
{
    const std::string cause = causeOf(result);
    auto found = std::find_if(causes.begin(), causes.end(), [&](const CauseTally &c) { return c.cause == cause; });
    if (found == causes.end())
        found = causes.insert(causes.end(), {cause, 0, nullptr, nullptr});
    ++found->count;
    const auto takeFirst = [&](const CaseResult *&first) {
        if (first == nullptr || isBefore(result.id, first->id))
            first = &result;
    };
    takeFirst(found->first);
    if (result.details != nullptr && !result.details->reproducer.empty())
        takeFirst(found->reproduced);
}

// The element of a group, which is added if missing.
template <typename OfGroup>
OfGroup &elementOf(check::Api api, const check::Group *group, std::vector<OfGroup> &groups)
{
    const auto found =
        std::find_if(groups.begin(), groups.end(), [&](const OfGroup &g) { return g.api == api && g.group == group; });
    if (found != groups.end())
        return *found;
    OfGroup &added = groups.emplace_back();
    added.api = api;
    added.group = group;
    return added;
}

} // namespace

const std::string &CaseResult::cause() const
{
    static const std::string none;
    return details != nullptr ? details->cause : none;
}

std::string causeOf(const CaseResult &result)
{
    const bool byVerdict = result.verdict == Verdict::Missing || isImprovement(result.verdict);
    return std::string(byVerdict ? nameOf(result.verdict) : nameOf(result.status)) +
           (result.cause().empty() ? "" : ": " + result.cause());
}

std::vector<PlannedGroup> planOf(const std::vector<CaseId> &cases)
{
    std::vector<PlannedGroup> plan;
    for (const CaseId &id : cases)
        ++elementOf(id.api, id.group, plan).cases;
    return plan;
}

size_t GroupTally::count(std::initializer_list<check::Status> some) const
{
    size_t sum = 0;
    for (const check::Status status : some)
        if (const auto found = statuses.find(status); found != statuses.end())
            sum += found->second;
    return sum;
}

size_t GroupTally::tested() const
{
    size_t sum = 0;
    for (const auto &[status, number] : statuses)
        sum += status == check::Status::Skip ? 0 : number;
    return sum;
}

CheckTally tallyOf(const std::vector<CaseResult> &results, const std::vector<PlannedGroup> &plan)
{
    CheckTally tally;
    for (const PlannedGroup &planned : plan)
        elementOf(planned.api, planned.group, tally.groups).planned = planned.cases;
    for (const CaseResult &result : results) {
        GroupTally &group = elementOf(result.id.api, result.id.group, tally.groups);
        ++group.cases;
        if (result.verdict != Verdict::Missing)
            ++group.statuses[result.status];
        group.rays += result.rays;
        group.seconds += result.seconds;
        ++tally.verdicts[result.verdict];
        if (isImprovement(result.verdict))
            add(result, tally.improvements);
        else if (!isSuccess(result.verdict))
            add(result, tally.failures);
        else if (result.verdict == Verdict::Skip)
            add(result, tally.skips);
        else if (result.verdict == Verdict::Flake || result.verdict == Verdict::KnownFlake)
            add(result, tally.flakes);
    }
    std::stable_sort(tally.groups.begin(), tally.groups.end(), [](const GroupTally &a, const GroupTally &b) {
        return a.api != b.api ? a.api == check::Api::Khr : a.group < b.group;
    });
    for (std::vector<CauseTally> *causes : {&tally.failures, &tally.improvements, &tally.flakes, &tally.skips})
        std::stable_sort(causes->begin(), causes->end(),
                         [](const CauseTally &a, const CauseTally &b) { return a.count > b.count; });
    return tally;
}

namespace
{

constexpr const char *kNotRun = "Missing";

std::vector<const CaseResult *> byName(const std::vector<CaseResult> &results)
{
    std::vector<std::pair<std::string, const CaseResult *>> named;
    for (const CaseResult &result : results)
        named.emplace_back(nameOf(result.id), &result);
    std::sort(named.begin(), named.end());
    std::vector<const CaseResult *> sorted;
    for (const auto &[name, result] : named)
        sorted.push_back(result);
    return sorted;
}

const char *statusOf(const CaseResult &result)
{
    return result.verdict == Verdict::Missing ? kNotRun : nameOf(result.status);
}

std::string junitCase(const CaseResult &result)
{
    std::string text = fmt::format(R"(    <testcase classname="{}.{}" name="{}" time="{:.3f}")", nameOf(result.id.api),
                                   result.id.group->name, nameOf(result.id), result.seconds);
    if (!isSuccess(result.verdict))
        return text + fmt::format("><failure type=\"{}\" message=\"{}\">{}</failure></testcase>\n",
                                  nameOf(result.verdict), markupText(causeOf(result)),
                                  markupText(result.details != nullptr ? result.details->text : ""));
    if (result.verdict == Verdict::Skip)
        return text + fmt::format("><skipped message=\"{}\"/></testcase>\n", markupText(result.cause()));
    if (result.verdict != Verdict::Pass)
        return text + fmt::format("><system-out>{}: {}</system-out></testcase>\n", nameOf(result.verdict),
                                  markupText(causeOf(result)));
    return text + "/>\n";
}

void writeGroup(const GroupTally &group, JsonWriter &json)
{
    using check::Status;
    json.beginObject().member("api", nameOf(group.api)).member("group", group.group->name);
    json.member("planned", group.planned).member("cases", group.cases);
    json.member("pass", group.count({Status::Pass})).member("fail", group.count({Status::Fail}));
    json.member("skip", group.count({Status::Skip})).member("crash", group.count({Status::Crash}));
    json.member("timeout", group.count({Status::Timeout})).member("deviceLost", group.count({Status::DeviceLost}));
    json.member("rays", group.rays).member("seconds", group.seconds).end();
}

void writeCauses(const char *name, const std::vector<CauseTally> &causes, JsonWriter &json)
{
    json.list(name, causes, [&](const CauseTally &cause) {
        json.beginObject().member("cause", cause.cause).member("cases", cause.count);
        json.member("case", nameOf(cause.first->id));
        if (const auto &details = cause.first->details; details != nullptr) {
            json.member("detail", details->text);
            if (details->before != 0)
                json.member("before", details->before);
        }
        if (cause.reproduced != nullptr)
            json.member("reproducer", cause.reproduced->details->reproducer);
        json.end();
    });
}

void appendCauses(const char *heading, const std::vector<CauseTally> &causes, const RunFacts &facts, std::string &text)
{
    if (causes.empty())
        return;
    text += fmt::format("\n{}:\n", heading);
    for (const CauseTally &cause : causes) {
        text += fmt::format("  {}\n    {}, the first of which is {}\n", cause.cause, counted(cause.count, "case"),
                            nameOf(cause.first->id));
        if (cause.reproduced == nullptr)
            continue;
        const auto &details = cause.reproduced->details;
        if (details->before != 0)
            text += fmt::format("    only after the {} before it in its process, which this runs first:\n",
                                counted(details->before, "case"));
        text += fmt::format("    vellum check {}--replay {}\n", facts.replayOptions, details->reproducer);
    }
}

// "2 expected failures, 1 flake"; empty if everything is as the table says.
std::string otherVerdicts(const CheckTally &tally)
{
    std::string text;
    const auto add = [&](std::initializer_list<Verdict> verdicts, const char *one, const char *many) {
        size_t sum = 0;
        for (const Verdict verdict : verdicts)
            if (const auto found = tally.verdicts.find(verdict); found != tally.verdicts.end())
                sum += found->second;
        if (sum != 0)
            text += (text.empty() ? "" : ", ") + counted(sum, one, many);
    };
    add({Verdict::ExpectedFail}, "expected failure", nullptr);
    add({Verdict::ImprovedToPass, Verdict::ImprovedToFail, Verdict::ImprovedToSkip}, "unexpected improvement", nullptr);
    add({Verdict::Flake}, "flake", nullptr);
    add({Verdict::KnownFlake}, "known flake", nullptr);
    add({Verdict::Missing}, "case not run", "cases not run");
    return text;
}

// Groups of which fewer cases were tested than a quick run has; empty if there are none.
std::string littleTested(const CheckTally &tally)
{
    std::string few;
    std::string none;
    for (const GroupTally &group : tally.groups) {
        if (group.tested() >= group.least())
            continue;
        std::string &list = group.tested() == 0 ? none : few;
        list += (list.empty() ? "" : ", ") + nameOf(group.api, *group.group);
        std::string reasons = group.tested() == 0 ? "" : fmt::format("{} of {}", group.tested(), group.planned);
        if (const size_t skipped = group.count({check::Status::Skip}); skipped != 0)
            reasons += fmt::format("{}{} skipped", reasons.empty() ? "" : ", ", skipped);
        list += reasons.empty() ? "" : " (" + reasons + ")";
    }
    return (few.empty() ? "" : "\nlittle tested: " + few + "\n") + (none.empty() ? "" : "\nnot tested: " + none + "\n");
}

} // namespace

std::string resultsCsv(const std::vector<CaseResult> &results)
{
    std::string text;
    for (const CaseResult *result : byName(results))
        text += fmt::format("{},{},{:.6f}\n", nameOf(result->id), nameOf(result->verdict), result->seconds);
    return text;
}

std::string failuresCsv(const std::vector<CaseResult> &results)
{
    std::string text;
    for (const CaseResult *result : byName(results))
        if (!isSuccess(result->verdict))
            text += fmt::format("{},{}\n", nameOf(result->id), nameOf(result->verdict));
    return text;
}

std::string junitXml(const RunFacts &facts, const std::vector<CaseResult> &results)
{
    std::string properties;
    for (const DeviceSummary::Fault &fault : facts.device.knownFaults)
        properties += fmt::format("      <property name=\"known fault\" value=\"{}: {}\"/>\n", markupText(fault.text),
                                  markupText(fault.response));
    if (!facts.incomplete.empty())
        properties += fmt::format("      <property name=\"incomplete\" value=\"{}\"/>\n", markupText(facts.incomplete));
    if (!properties.empty())
        properties = "    <properties>\n" + properties + "    </properties>\n";
    std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"vellum check\">\n";
    for (const GroupTally &group : tallyOf(results, facts.plan).groups) {
        std::string cases;
        size_t failures = 0;
        size_t skipped = 0;
        for (const CaseResult &result : results) {
            if (result.id.api != group.api || result.id.group != group.group)
                continue;
            cases += junitCase(result);
            failures += isSuccess(result.verdict) ? 0U : 1U;
            skipped += result.verdict == Verdict::Skip ? 1U : 0U;
        }
        text +=
            fmt::format("  <testsuite name=\"{}.{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\" time=\"{:.3f}\">\n",
                        nameOf(group.api), group.group->name, group.cases, failures, skipped, group.seconds);
        text += properties + cases + "  </testsuite>\n";
    }
    return text + "</testsuites>\n";
}

std::string resultsJson(const RunFacts &facts, const std::vector<CaseResult> &results)
{
    const CheckTally tally = tallyOf(results, facts.plan);
    JsonWriter json;
    beginReport(json, "check");
    json.member("version", facts.version);
    json.member("device", facts.device.name).member("implementation", facts.device.implementation);
    json.member("seed", std::to_string(facts.seed)).member("seconds", facts.seconds);
    json.member("selection", facts.selection);
    if (!facts.incomplete.empty())
        json.member("incomplete", facts.incomplete);
    if (!facts.shard.empty())
        json.member("shard", facts.shard);
    if (!facts.replayOptions.empty())
        json.member("replayOptions", facts.replayOptions);
    json.list("knownFaults", facts.device.knownFaults, [&](const DeviceSummary::Fault &fault) {
        json.beginObject().member("fault", fault.text).member("response", fault.response).end();
    });
    json.list("groups", tally.groups, [&](const GroupTally &group) { writeGroup(group, json); });
    std::vector<CauseTally> failures = tally.failures;
    failures.insert(failures.end(), tally.improvements.begin(), tally.improvements.end());
    writeCauses("failures", failures, json);
    writeCauses("flakes", tally.flakes, json);
    writeCauses("skips", tally.skips, json);
    json.list("cases", byName(results), [&](const CaseResult *result) {
        json.beginObject().member("case", nameOf(result->id)).member("result", nameOf(result->verdict));
        json.member("status", statusOf(*result)).member("seconds", result->seconds).member("rays", result->rays);
        if (!result->cause().empty())
            json.member("cause", result->cause());
        if (result->details != nullptr && !result->details->text.empty())
            json.member("detail", result->details->text);
        if (result->details != nullptr && result->details->before != 0)
            json.member("before", result->details->before);
        if (result->details != nullptr && !result->details->reproducer.empty())
            json.member("reproducer", result->details->reproducer);
        json.end();
    });
    json.end();
    return json.text() + "\n";
}

std::string resultsTable(const RunFacts &facts, const std::vector<CaseResult> &results)
{
    using check::Status;
    const CheckTally tally = tallyOf(results, facts.plan);
    size_t width = 5;
    for (const GroupTally &group : tally.groups)
        width = std::max(width, group.group->name.size() + 4);
    std::string text = fmt::format("{:<{}} {:>8} {:>8} {:>7} {:>7} {:>7} {:>7} {:>14} {:>9}\n", "group", width, "cases",
                                   "pass", "fail", "skip", "crash", "timeout", "rays", "seconds");
    for (const GroupTally &group : tally.groups) {
        if (group.cases == 0) // the run has ended before
            continue;
        text +=
            fmt::format("{:<{}} {:>8} {:>8} {:>7} {:>7} {:>7} {:>7} {:>14} {:>9.1f}\n",
                        fmt::format("{}.{}", nameOf(group.api), group.group->name), width, grouped(group.cases),
                        grouped(group.count({Status::Pass})), grouped(group.count({Status::Fail})),
                        grouped(group.count({Status::Skip})), grouped(group.count({Status::Crash, Status::DeviceLost})),
                        grouped(group.count({Status::Timeout})), grouped(group.rays), group.seconds);
    }
    appendCauses("failures", tally.failures, facts, text);
    appendCauses("better than the baseline, which is to be updated", tally.improvements, facts, text);
    appendCauses("flakes", tally.flakes, facts, text);
    appendCauses("skipped", tally.skips, facts, text);
    text += littleTested(tally);
    if (!facts.device.knownFaults.empty())
        text += fmt::format("\nknown faults of the device: {}, because of which some things are not tested: "
                            "knownFaults in {}\n",
                            facts.device.knownFaults.size(), kResultsFile);
    const std::string others = otherVerdicts(tally);
    size_t failures = 0;
    for (const auto &[verdict, number] : tally.verdicts)
        failures += isSuccess(verdict) || isImprovement(verdict) ? 0U : number;
    size_t tested = 0;
    size_t skipped = 0;
    for (const GroupTally &group : tally.groups) {
        tested += group.tested();
        skipped += group.count({Status::Skip});
    }
    text += facts.device.implementation.empty() ? "\n" : "\nmicromaps: " + facts.device.implementation + "\n";
    text += fmt::format(
        "{}{}: {} in {:.1f} s{}, {}{}\n", facts.device.name,
        facts.incomplete.empty() ? "" : ", incomplete (" + facts.incomplete + ")", counted(tested, "case"),
        facts.seconds, skipped == 0 ? "" : fmt::format(", {} skipped", grouped(skipped)),
        failures == 0 ? "no failure" : counted(failures, "failure"), others.empty() ? "" : " (" + others + ")");
    return text;
}

namespace
{

constexpr const char *kFailures = "failures";

// Failures and flakes of a cause have reproducers of their own.
std::string reproducerKey(const std::string &cause, Verdict verdict)
{
    return (isSuccess(verdict) ? "flake: " : "failure: ") + cause;
}

} // namespace

OutputFolder::OutputFolder(std::filesystem::path path, bool force) : path_(std::move(path))
{
    std::error_code error;
    if (std::filesystem::exists(path_, error) && !std::filesystem::is_directory(path_, error))
        throw Error(utf8Text(path_) + " cannot be written: it is not a directory");
    const bool foreign = std::filesystem::is_directory(path_, error) && !std::filesystem::is_empty(path_, error) &&
                         !std::filesystem::exists(path_ / kResultsFile, error);
    if (foreign && !force)
        throw Error(utf8Text(path_) + " has files that vellum check did not write; --force writes into it");
    std::filesystem::create_directories(path_ / kFailures, error);
    if (error)
        throw Error(utf8Text(path_) + " cannot be written: " + error.message());
    checkFolderOf(path_ / kResultsFile);
    if (std::filesystem::exists(path_ / kResultsFile, error))
        removeFailures();
}

void OutputFolder::removeFailures() const
{
    std::error_code error;
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::directory_iterator(path_ / kFailures, error))
        if (parseCase(utf8Text(entry.path().stem())))
            files.push_back(entry.path());
    for (const std::filesystem::path &file : files) {
        std::filesystem::remove(file, error);
        if (error)
            throw Error(utf8Text(file) + " cannot be removed: " + error.message());
    }
}

std::string OutputFolder::writeFailure(const Finished &finished, uint64_t seed)
{
    if (++written_[reproducerKey(causeOf(finished.outcome), finished.verdict)] > kMostReproducers)
        return {};
    const std::string name = nameOf(finished.id);
    const std::filesystem::path path = reproducerIn(path_, finished.id);
    // Larger cases are not shrunk: the seed makes them.
    const std::string &shrunk = finished.outcome.reproducer;
    writeWhole(path,
               write(Reproducer{name, finished.id.api, std::string(finished.id.group->name), seedOf(seed, finished.id),
                                shrunk.size() <= kMostReproducerBytes ? shrunk : std::string(),
                                earlierCases(finished.before, seed)}));
    for (const check::OutcomeFile &file : finished.outcome.files)
        writeWhole(path_ / kFailures / (name + "." + file.extension), file.bytes);
    return utf8Text(path);
}

std::filesystem::path OutputFolder::reproducerIn(const std::filesystem::path &folder, const CaseId &id)
{
    return folder / kFailures / (nameOf(id) + ".json");
}

std::string OutputFolder::copyFailure(const std::filesystem::path &from, const CaseId &id) const
{
    std::error_code error;
    for (const auto &entry : std::filesystem::directory_iterator(from, error)) {
        const std::filesystem::path file = entry.path().filename();
        if (!utf8Text(file).starts_with(nameOf(id) + "."))
            continue;
        const std::filesystem::path copy = path_ / kFailures / file;
        std::filesystem::copy_file(entry.path(), copy, std::filesystem::copy_options::overwrite_existing, error);
        if (error)
            throw Error(utf8Text(copy) + " cannot be written: " + error.message());
    }
    return utf8Text(reproducerIn(path_, id));
}

void OutputFolder::writeResults(const RunFacts &facts, const std::vector<CaseResult> &results) const
{
    writeWhole(path_ / "results.csv", resultsCsv(results));
    writeWhole(path_ / "failures.csv", failuresCsv(results));
    writeWhole(path_ / "junit.xml", junitXml(facts, results));
    writeWhole(path_ / kResultsFile, resultsJson(facts, results));
}

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
                      .status =
                          parseStatus(JsonReader::textOf(object, "status")).value_or(check::Status::Crash), // "Missing"
                      .verdict = *verdict,
                      .seconds = numberOf(object, "seconds"),
                      .rays = static_cast<uint64_t>(numberOf(object, "rays"))};
    CaseResult::Details details{JsonReader::textOr(object, "cause"),
                                JsonReader::textOr(object, "detail"),
                                {},
                                object.HasMember("before") ? JsonReader::numberOf(object, "before") : 0};
    if (result.status == check::Status::Pass && details.cause.empty())
        return result;
    // The folder may have another path now.
    const std::filesystem::path file = OutputFolder::reproducerIn(folder, *id);
    if (object.HasMember("reproducer") && std::filesystem::exists(file))
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
        for (const PlannedGroup &group : run.facts.plan)
            elementOf(group.api, group.group, merged.facts.plan).cases += group.cases;
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
    std::vector<CaseResult *> failures;
    for (CaseResult &result : runs.results)
        if (result.details && !result.details->reproducer.empty())
            failures.push_back(&result);
    std::ranges::sort(failures, [](const CaseResult *a, const CaseResult *b) { return isBefore(a->id, b->id); });
    std::map<std::string, size_t> copied;
    for (CaseResult *result : failures) {
        CaseResult::Details details = *result->details;
        const bool more = ++copied[reproducerKey(causeOf(*result), result->verdict)] > OutputFolder::kMostReproducers;
        details.reproducer = more ? "" : folder.copyFailure(utf8Path(details.reproducer).parent_path(), result->id);
        result->details = std::make_shared<CaseResult::Details>(std::move(details));
    }
}

} // namespace vellum::cli
