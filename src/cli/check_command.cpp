// SPDX-License-Identifier: Apache-2.0
// `vellum check`
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/check/cases.h"
#include "cli/check/results.h"
#include "cli/check/runner.h"
#include "cli/check/worker.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "gpu/device_selection.h"
#include "gpu/instance.h"
#include "inspect/report_parts.h"
#include "job/shard.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kCheckDetails = R"(
Tests a device's opacity micromaps, its own or those of the layer, with random cases of VK_KHR_opacity_micromap and
VK_EXT_opacity_micromap, whose results are compared with an oracle on the CPU. A case is named API.GROUP.NUMBER, such as
khr.resolution-query.0042; --seed and its name determine it. Cases run in processes of their own: a crash, a hang and a lost
device are results. A failure is run again in a new process; a crash or a hang that does not repeat, then once more after
the cases that its process ran before it. What passes both times is a flake.

FOLDER gets results.csv and failures.csv as deqp-runner writes them, junit.xml, results.json, and in failures/ the first
three failing cases of each cause as files for --replay, with what explains them.

The files of --baseline, --skips and --flakes are those of deqp-runner. A baseline has a line NAME,STATUS for each known
failure; the failures.csv of a run without --baseline is one. Skips and flakes are regular expressions that match a part of a name, one a line;
lines that begin with # are comments. Known failures and known flakes do not fail a run; cases of the baseline that improved
do. A filter, a line of a baseline and an expression that match no case are usage errors.

The exit status of --merge is that of all cases: 1 if one failed, even if a shard is missing; otherwise 125 if a shard is
missing or was interrupted. --no-layer keeps the layer out also where the environment turns it on, and fails where it cannot.

Examples:
  vellum check --quick
      the same cases on every machine, in about two minutes on two cores of a CPU; on the most powerful device
  vellum check --device radeon --no-layer --jobs 4 --baseline fails.txt --skips skips.txt --output results
      the driver's own micromaps, in continuous integration
  vellum check --filter 'khr.updates.*' --minutes 60 --seed 7
      new cases of one group for an hour
  vellum check --replay vellum-check/failures/khr.updates.0012.json
      one failure again
  vellum check --quick --shard 2/8 -o results-2
  vellum check --merge results-* -o results
      one of eight machines, and then the results of all; it fails where a shard is missing or has not ended
)";

struct CheckOptions {
    gpu::DeviceSelection device;
    std::optional<std::string> api; // ext, khr or both; what the device has without
    bool layer = true;
    std::string implementation;                       // empty: not given
    std::optional<std::filesystem::path> layerFolder; // instead of the one next to the program
    std::vector<std::string> filters;
    std::optional<std::filesystem::path> caseList;
    std::optional<std::filesystem::path> replay;
    std::optional<std::filesystem::path> baseline;
    std::vector<std::filesystem::path> skips;
    std::vector<std::filesystem::path> flakes;
    std::optional<double> minutes;
    job::Shard shard;
    std::vector<std::filesystem::path> merge; // folders of runs
    bool quick = false;
    bool failFast = false;
    bool failOnFlake = false;
    uint32_t jobs = 1;
    uint64_t seed = 1;
    double timeout = 60; // seconds
    std::filesystem::path output = "vellum-check";
    std::optional<std::filesystem::path> results; // besides those in `output`
    std::optional<std::filesystem::path> junit;
    bool force = false;
    bool list = false;
    bool groups = false;
    bool json = false;
    double progress = 10; // seconds between lines if stderr is not a terminal; 0: none
    bool worker = false;
};

// Returns the exit code. Throws Error.
int checkCommand(const CheckOptions &options);

constexpr double kSecondsBetweenWrites = 30;

// Sets the environment of this process and of the workers, which inherit it.
void prepareEnvironment(const CheckOptions &options)
{
    if (options.layer)
        gpu::offerLayer(options.layerFolder);
    else
        gpu::withdrawLayer();
    if (!variable("VELLUM_MESSAGE_LIMIT"))
        setVariable("VELLUM_MESSAGE_LIMIT",
                    "0"); // each report of the layer fails its case, even if it was reported before
    if (!options.implementation.empty())
        setVariable("VELLUM_IMPLEMENTATION", options.implementation);
}

std::vector<CaseId> readCaseList(const std::filesystem::path &path)
{
    std::vector<CaseId> cases;
    std::set<std::string> seen;
    forEachLine(path, [&](const std::string &line, const std::string &place) {
        const std::string name = line.substr(0, line.find(',')); // results.csv is a list, too
        const std::optional<CaseId> id = parseCase(name);
        if (!id)
            throw UsageError(place + ": there is no case " + name + "; vellum check --list prints them");
        if (seen.insert(name).second)
            cases.push_back(*id);
    });
    if (cases.empty())
        throw UsageError(utf8Text(path) + " lists no cases");
    return cases;
}

std::vector<check::Api> apisOf(const CheckOptions &options)
{
    if (!options.api || *options.api == "both")
        return {check::Api::Khr, check::Api::Ext};
    return {*options.api == "khr" ? check::Api::Khr : check::Api::Ext};
}

// "khr.levels.*", "ext.levels.*", ...
std::vector<std::string> groupFilters(const CaseSelection &selection)
{
    std::vector<std::string> filters;
    for (const check::Api api : selection.apis)
        for (const check::Group &group : check::groups())
            filters.push_back(fmt::format("{}.{}.*", nameOf(api), group.name));
    return filters;
}

CaseSelection selectionOf(const CheckOptions &options)
{
    CaseSelection selection;
    selection.apis = apisOf(options);
    selection.filters = options.filters;
    selection.quick = options.quick;
    selection.endless = options.minutes.has_value();
    selection.shard = options.shard;
    if (options.caseList) {
        selection.list = readCaseList(*options.caseList);
        selection.listed = true;
    }
    if (const std::optional<std::string> filter = idleFilter(selection))
        throw UsageError("--filter " + *filter + " matches no case" + (options.quick ? " of a quick run" : "") +
                         suggestion(*filter, groupFilters(selection)) + "; vellum check " +
                         (options.quick ? "--quick " : "") + "--list prints them");
    return selection;
}

Expectations expectationsOf(const CheckOptions &options)
{
    Expectations expectations(options.minutes || options.caseList); // a list may be of a run with --minutes
    if (options.baseline)
        expectations.addBaseline(*options.baseline);
    for (const std::filesystem::path &path : options.skips)
        expectations.addSkips(path);
    for (const std::filesystem::path &path : options.flakes)
        expectations.addFlakes(path);
    return expectations;
}

RunSettings settingsOf(const CheckOptions &options, const DeviceSummary &device)
{
    RunSettings settings;
    settings.worker = {.device = gpu::DeviceSelection(std::to_string(device.number)), .layer = options.layer};
    settings.seed = options.seed;
    settings.jobs = options.jobs;
    settings.timeout = options.timeout;
    settings.failFast = options.failFast;
    settings.failOnFlake = options.failOnFlake;
    if (options.minutes)
        settings.budget = 60 * *options.minutes;
    return settings;
}

// Removes the extensions that the device lacks, unless --api, --caselist or --filter names them: their cases are then
// skipped.
void removeMissing(const CheckOptions &options, const DeviceSummary &device, CaseSelection &selection)
{
    const auto lacks = [&](check::Api api) { return !device.has(api); };
    if (std::all_of(selection.apis.begin(), selection.apis.end(), lacks))
        throw Error(device.name + " has no " +
                    (selection.apis.size() > 1 ? "opacity micromaps" : extensionOf(selection.apis.front())));
    CaseSelection rest = selection;
    std::erase_if(rest.apis, lacks);
    if (!options.api && !idleFilter(rest))
        selection = std::move(rest);
}

int list(const CheckOptions &options)
{
    const std::vector<CaseId> cases = casesOf(selectionOf(options));
    if (options.json) {
        JsonWriter json;
        beginReport(json, "check --list");
        json.list("cases", cases, [&](const CaseId &id) { json.value(nameOf(id)); });
        fmt::print("{}\n", json.end().text());
        return static_cast<int>(ExitCode::Success);
    }
    for (const CaseId &id : cases)
        fmt::print("{}\n", nameOf(id));
    return static_cast<int>(ExitCode::Success);
}

// Those that have a case of --filter or --caselist.
std::vector<check::Group> selectedGroups(const CheckOptions &options)
{
    std::vector<check::Group> groups;
    const std::vector<PlannedGroup> plan = planOf(casesOf(selectionOf(options)));
    for (const check::Group &group : check::groups())
        if (std::ranges::find(plan, &group, &PlannedGroup::group) != plan.end())
            groups.push_back(group);
    return groups;
}

int printGroups(const CheckOptions &options)
{
    const std::vector<check::Group> groups = selectedGroups(options);
    if (options.json) {
        JsonWriter json;
        beginReport(json, "check --groups");
        json.list("groups", groups, [&](const check::Group &group) {
            json.beginObject().member("group", group.name).member("cases", group.cases);
            json.member("quick", group.quickCases());
            json.member("summary", group.summary).member("sentences", group.sentences).end();
        });
        fmt::print("{}\n", json.end().text());
        return static_cast<int>(ExitCode::Success);
    }
    for (const check::Group &group : groups)
        fmt::print("{} ({} cases of each extension, {} of them with --quick)\n  {}\n  Checks: {}\n", group.name,
                   group.cases, group.quickCases(), group.summary, group.sentences);
    return static_cast<int>(ExitCode::Success);
}

// A full disk does not end the run: `error` is what went wrong last.
template <typename Write>
void tryToWrite(std::string &error, Write &&write)
{
    try {
        write();
    } catch (const Error &caught) {
        error = caught.what();
    }
}

// Prints the results, and writes them wherever the options say. Throws Error when everything that can be written is
// written. `error`: of writing before.
void publish(const CheckOptions &options, const OutputFolder &folder, const RunFacts &facts,
             const std::vector<CaseResult> &results, std::string error = {})
{
    std::fputs((options.json ? resultsJson(facts, results) : resultsTable(facts, results)).c_str(), stdout);
    std::fflush(stdout);
    tryToWrite(error, [&] { folder.writeResults(facts, results); });
    if (options.results)
        tryToWrite(error, [&] { writeWhole(*options.results, resultsCsv(results)); });
    if (options.junit)
        tryToWrite(error, [&] { writeWhole(*options.junit, junitXml(facts, results)); });
    if (!error.empty())
        throw Error(error);
}

// Why nothing was tested; empty where something was.
std::string notTested(const std::vector<CaseResult> &results)
{
    const auto skipped = [](const CaseResult &result) { return result.status == check::Status::Skip; };
    if (!std::all_of(results.begin(), results.end(), skipped))
        return {};
    return results.empty() ? "no case has ended in time"
                           : "all cases were skipped, the first because: " + results.front().cause();
}

int exitCodeOf(const CheckOptions &options, const std::vector<CaseResult> &results)
{
    const auto flakes = static_cast<size_t>(std::ranges::count(results, Verdict::Flake, &CaseResult::verdict));
    if (options.failOnFlake && flakes != 0)
        std::fprintf(stderr, "vellum: %s the run, by --fail-on-flake\n",
                     counted(flakes, "flake fails", "flakes fail").c_str());
    if (std::ranges::any_of(results, [&](const CaseResult &r) { return failsRun(r.verdict, options.failOnFlake); }))
        return static_cast<int>(ExitCode::Failed);
    if (const std::string why = notTested(results); !why.empty()) {
        std::fprintf(stderr, "vellum: nothing was tested: %s\n", why.c_str());
        return static_cast<int>(ExitCode::NotRun);
    }
    return static_cast<int>(ExitCode::Success);
}

int merge(const CheckOptions &options)
{
    std::error_code error;
    for (const std::filesystem::path &run : options.merge)
        if (std::filesystem::equivalent(resultsOf(run), options.output / kResultsFile, error))
            throw UsageError(utf8Text(run) + " has results that are to be merged; --output names another folder");
    MergedRuns merged = mergeRuns(options.merge);
    const OutputFolder output(options.output, options.force);
    copyFailures(merged, output);
    publish(options, output, merged.facts, merged.results);
    const int code = exitCodeOf(options, merged.results);
    if (merged.facts.incomplete.empty())
        return code;
    std::fprintf(stderr, "vellum: the results are not whole: %s\n", merged.facts.incomplete.c_str());
    return code == static_cast<int>(ExitCode::Success) ? static_cast<int>(ExitCode::NotRun) : code;
}

// The options that chose the device and who implements micromaps, for the command line of --replay.
std::string deviceOptions(const CheckOptions &options)
{
    const auto quoted = [](const std::string &word) {
        const bool plain = std::ranges::all_of(
            word, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || std::strchr("-_./", c); });
        return plain && !word.empty() ? word : '"' + word + '"';
    };
    std::string text;
    if (!options.layer)
        text += "--no-layer ";
    if (options.device.text())
        text += "--device " + quoted(*options.device.text()) + " ";
    if (!options.implementation.empty())
        text += "--implementation " + options.implementation + " ";
    if (options.layerFolder)
        text += "--layer-path " + quoted(utf8Text(*options.layerFolder)) + " ";
    return text;
}

// Says that a run continues in the place of one that was not whole.
void reportReplaced(const std::filesystem::path &folder)
{
    if (const std::string why = incompleteIn(folder); !why.empty())
        std::fprintf(stderr, "vellum: the results in %s are not whole (%s); this run replaces them\n",
                     utf8Text(folder).c_str(), why.c_str());
}

// Collects the results and writes them.
class Results
{
public:
    Results(const CheckOptions &options, const DeviceSummary &device, const CaseSelection &selection)
        : options_(options), folder_(options.output, options.force)
    {
        reportReplaced(options.output);
        facts_.device = device;
        facts_.replayOptions = deviceOptions(options);
        facts_.seed = options.seed;
        if (options.shard.count > 1)
            facts_.shard = fmt::format("{}/{}", options.shard.number, options.shard.count);
        facts_.selection = describe(selection);
        facts_.plan = planOf(casesOf(selection));
        facts_.incomplete = "it has not ended"; // what a killed run leaves
        write();
    }

    void add(const Finished &finished)
    {
        CaseResult &result = results_.emplace_back();
        result.id = finished.id;
        result.status = finished.outcome.status;
        result.verdict = finished.verdict;
        result.seconds = finished.seconds;
        result.rays = finished.outcome.rays;
        if (!isSuccess(result.verdict))
            ++failures_;
        if (finished.outcome.cause.empty() && result.status == check::Status::Pass)
            return;
        CaseResult::Details details{finished.outcome.cause, finished.outcome.detail, {}, finished.before.size()};
        std::replace(details.cause.begin(), details.cause.end(), '\n', ' ');
        details.cause = printable(std::move(details.cause)); // a driver may have printed it
        const bool ran = finished.verdict != Verdict::Missing && finished.verdict != Verdict::ExpectedFail;
        if (ran && result.status != check::Status::Pass && result.status != check::Status::Skip)
            tryToWrite(error_, [&] { details.reproducer = folder_.writeFailure(finished, options_.seed); });
        result.details = std::make_shared<CaseResult::Details>(std::move(details));
        if (!isSuccess(result.verdict) && announced_.insert(causeOf(result)).second)
            std::fprintf(stderr, "%s%s: %s\n", isTerminal(stderr) ? "\r\033[K" : "", nameOf(result.id).c_str(),
                         causeOf(result).c_str());
    }

    void writeSometimes(double seconds)
    {
        facts_.seconds = seconds;
        if (seconds < nextWrite_ || results_.empty())
            return;
        nextWrite_ = seconds + kSecondsBetweenWrites;
        write();
    }

    // Throws Error when everything that can be written is written. `incomplete`: why the run ended early; empty if it
    // did not.
    void publishAll(double seconds, const std::string &incomplete)
    {
        facts_.seconds = seconds;
        facts_.incomplete = incomplete;
        publish(options_, folder_, facts_, results_, error_);
    }

    [[nodiscard]] size_t size() const { return results_.size(); }
    [[nodiscard]] size_t failures() const { return failures_; }
    // An empty shard has no case, and is no failure.
    [[nodiscard]] int exitCode() const
    {
        if (!facts_.plan.empty() || !results_.empty() || facts_.shard.empty())
            return exitCodeOf(options_, results_);
        std::fprintf(stderr, "vellum: shard %s has no cases\n", facts_.shard.c_str());
        return static_cast<int>(ExitCode::Success);
    }

private:
    void write()
    {
        tryToWrite(error_, [&] { folder_.writeResults(facts_, results_); });
    }

    const CheckOptions &options_;
    OutputFolder folder_;
    RunFacts facts_;
    std::vector<CaseResult> results_;
    size_t failures_ = 0;
    std::set<std::string> announced_; // causes
    std::string error_;               // of writing
    double nextWrite_ = kSecondsBetweenWrites;
};

// Cases of a list or of --api whose extension the device lacks.
void skipMissing(const DeviceSummary &device, CaseSelection &selection, Results &results)
{
    const auto lacks = [&](check::Api api) { return !device.has(api); };
    for (const CaseId &id : casesOf(selection)) {
        if (!lacks(id.api))
            continue;
        check::Outcome outcome;
        outcome.status = check::Status::Skip;
        outcome.cause = std::string("the device has no ") + extensionOf(id.api);
        results.add({id, outcome, Verdict::Skip, 0});
    }
    std::erase_if(selection.apis, lacks);
    std::erase_if(selection.list, [&](const CaseId &id) { return lacks(id.api); });
}

// Describes the progress of a run.
class RunProgress
{
public:
    // Must be created at the start of the run.
    RunProgress(const RunSettings &settings, const Schedule &schedule, const Results &results)
        : settings_(settings), schedule_(schedule), results_(results), cases_(results.size() + schedule.remaining())
    {
    }
    // "120 of 2,240 cases, 1 failure, khr.levels, about 85 s left"
    [[nodiscard]] std::string at(double seconds) const
    {
        std::string text = settings_.budget
                               ? counted(results_.size(), "case")
                               : fmt::format("{} of {}", grouped(results_.size()), counted(cases_, "case"));
        text += ", " + counted(results_.failures(), "failure");
        if (const std::string groups = schedule_.running(); !groups.empty())
            text += ", " + groups;
        const double spent = schedule_.spentSeconds();
        if (settings_.budget)
            text += fmt::format(", {:.0f} s left", std::max(0.0, *settings_.budget - seconds));
        else if (spent > 0 && 3 * results_.size() >= cases_) // before, it is not known how slow the other groups are
            text += fmt::format(", about {:.0f} s left", seconds * schedule_.expectedSeconds() / spent);
        return text;
    }

private:
    const RunSettings &settings_;
    const Schedule &schedule_;
    const Results &results_;
    size_t cases_;
};

int runCases(const CheckOptions &options, const DeviceSummary &device, CaseSelection selection,
             const Expectations &expectations)
{
    Results results(options, device, selection);
    skipMissing(device, selection, results);
    Schedule schedule = makeSchedule(selection);
    const RunSettings settings = settingsOf(options, device);
    auto progress = std::make_optional<ProgressLine>("checking", options.progress);
    const RunProgress standing(settings, schedule, results);
    Runner *running = nullptr;
    Runner runner(
        settings, expectations, [&](const Finished &finished) { results.add(finished); },
        [&] {
            const double seconds = running->seconds();
            results.writeSometimes(seconds);
            progress->update([&] { return standing.at(seconds); });
        });
    running = &runner;
    std::string error;
    try {
        runner.run(schedule);
    } catch (const std::exception &caught) { // such as no memory: what was found before is written
        error = caught.what();
    }
    const bool interrupted = Interruptible::interrupted();
    progress.reset();
    results.publishAll(runner.seconds(), interrupted ? "interrupted" : error);
    if (interrupted)
        Interruptible::die();
    if (!error.empty())
        throw Error("the run ended early: " + error);
    return results.exitCode();
}

// The case of --replay.
CaseId caseOf(const std::filesystem::path &path)
{
    const Reproducer reproducer = readReproducer(path);
    const std::optional<CaseId> id = parseCase(reproducer.name);
    if (!id || id->api != reproducer.api || id->group->name != reproducer.group)
        throw UsageError(utf8Text(path) + ": there is no case " + reproducer.name);
    return *id;
}

int replay(const CheckOptions &options, const DeviceSummary &device, const CaseId &id)
{
    RunSettings settings = settingsOf(options, device);
    settings.replay = readFile(*options.replay);
    Schedule schedule;
    schedule.add(Stream(id.api, *id.group, {id.number}));
    const Expectations none;
    std::optional<Finished> result;
    Runner runner(
        settings, none, [&](const Finished &finished) { result = finished; }, [] {});
    runner.run(schedule);
    if (Interruptible::interrupted())
        Interruptible::die();
    if (!result)
        throw Error("the case was not run");
    fmt::print("{}: {}\nmicromaps: {}\n", nameOf(id), printable(causeOf(result->outcome)), device.implementation);
    if (const std::string before = namesOf(parseReproducer(settings.replay).before); !before.empty())
        fmt::print("run after these in the same process: {}\n", before);
    const auto &files = result->outcome.files;
    const auto account = std::ranges::find(files, "txt", &check::OutcomeFile::extension);
    if (account != files.end())
        fmt::print("\n{}", account->bytes);
    else if (!result->outcome.detail.empty())
        fmt::print("{}\n", result->outcome.detail);
    if (result->verdict == Verdict::Skip)
        return static_cast<int>(ExitCode::NotRun);
    return static_cast<int>(isSuccess(result->verdict) ? ExitCode::Success : ExitCode::Failed);
}

// Returns the exit code. Throws Error.
int checkCommand(const CheckOptions &options)
{
    if (options.worker)
        return runWorker({options.device, apisOf(options).front(), options.layer});
    if (options.groups)
        return printGroups(options);
    if (options.list)
        return list(options);
    if (!options.merge.empty())
        return merge(options);
    for (const auto &file : {options.results, options.junit}) {
        if (!file)
            continue;
        std::error_code error;
        std::filesystem::path made = *file; // or the first of the folders that are made for it
        while (!made.parent_path().empty() && !std::filesystem::exists(made.parent_path(), error))
            made = made.parent_path();
        checkFolderOf(made);
    }
    const Interruptible interruptible;
    prepareEnvironment(options);
    CaseSelection selection = selectionOf(options);
    if (options.replay) {
        selection.listed = true;
        selection.list = {caseOf(*options.replay)};
        selection.apis = {selection.list.front().api};
    }
    const Expectations expectations = expectationsOf(options);
    CaseSelection all = selection; // a shard may be empty
    all.shard = {};
    if (makeSchedule(all).streams() == 0)
        throw UsageError("no case is selected; vellum check --list prints them");
    DeviceSummary device;
    try {
        device = findDevice({.device = options.device, .layer = options.layer}, options.timeout);
        if (!options.layer && device.implementation.find(gpu::kLayerName) != std::string::npos)
            throw Error("--no-layer does not keep the layer out: micromaps are " + device.implementation +
                        ". Something else than VK_INSTANCE_LAYERS turns it on, such as a pattern in "
                        "VK_LOADER_LAYERS_ENABLE, Vulkan Configurator, or a manifest of an implicit layer");
        removeMissing(options, device, selection);
    } catch (const UsageError &) {
        throw;
    } catch (const Error &error) {
        if (Interruptible::interrupted())
            Interruptible::die();
        std::fprintf(stderr, "vellum: %s\n", error.what());
        return static_cast<int>(ExitCode::NotRun);
    }
    if (options.replay)
        return replay(options, device, selection.list.front());
    return runCases(options, device, std::move(selection), expectations);
}

constexpr uint32_t kMostJobs = 4; // without --jobs

void declareSelection(CLI::App &command, CheckOptions &options)
{
    command.option_defaults()->group(kSelection);
    command.add_option("--filter", options.filters, "Only cases that match this glob; repeatable")
        ->type_name("GLOB")
        ->take_all();
    command
        .add_option("--caselist", options.caseList,
                    "Only the cases of this file, a name a line; what follows a comma is ignored")
        ->type_name("FILE");
    command.add_option("--skips", options.skips, "Do not run the cases that match a line of this file; repeatable")
        ->type_name("FILE")
        ->take_all();
    command.add_flag("--quick", options.quick, "Only the first cases of each group, about two minutes on a CPU");
    command
        .add_option("--minutes", options.minutes, "Run for this long, shared by all groups; new cases without an end")
        ->check(between(0.001, 100000))
        ->type_name("MINUTES");
    command
        .add_option_function<std::string>(
            "--shard", [&options](const std::string &text) { options.shard = job::parseShard(text); },
            "Only the cases of part K of N, of which each machine runs another; --merge puts them together")
        ->type_name("K/N");
    command.add_flag("--fail-fast", options.failFast, "End with the first failure");
    command.add_flag("--fail-on-flake", options.failOnFlake, "Flakes that --flakes does not name fail the run");
    command.add_option("--seed", options.seed, "Another number makes other cases [1]")
        ->check(wholeBetween(0, UINT64_MAX))
        ->type_name("NUMBER");
    command
        .add_option("--merge", options.merge,
                    "Instead of running cases, put together the results of runs in these folders, such as all shards")
        ->type_name("FOLDER...");
    command.add_option("--replay", options.replay, "Run the case of this file, which an earlier run wrote")
        ->type_name("FILE");
    command.add_flag("--list", options.list, "Print the names of the cases instead of running them");
    command.add_flag("--groups", options.groups,
                     "Print which sentences of the specification each group tests, or those of --filter; run none");
}

void declareOutput(CLI::App &command, CheckOptions &options)
{
    command.option_defaults()->group(kOutput);
    command.add_option("-o,--output", options.output, "The folder to write to [vellum-check]")->type_name("FOLDER");
    command.add_flag("--force", options.force, "Write into a folder that has other files");
    command.add_option("--results", options.results, "Write results.csv here as well")->type_name("FILE");
    command.add_option("--junit", options.junit, "Write junit.xml here as well")->type_name("FILE");
    command.add_option("--baseline", options.baseline, "Known failures, which do not fail the run")->type_name("FILE");
    command
        .add_option("--flakes", options.flakes,
                    "Failures of cases that match a line of this file do not fail the run; repeatable")
        ->type_name("FILE")
        ->take_all();
    command.add_flag("--json", options.json, "Print JSON");
    command
        .add_option("--progress", options.progress,
                    "Seconds between lines about the progress, where stderr is not a terminal; 0: none [10]")
        ->check(between(0, 86400))
        ->type_name("SECONDS");
}

void declareDevice(CLI::App &command, CheckOptions &options)
{
    command.option_defaults()->group(kDevice);
    takesWords(*command.add_option("-a,--api", options.api, "The extension to test [those that the device has]"),
               {"khr", "ext", "both"});
    addDeviceOption(command, options.device);
    command.add_flag("!--no-layer", options.layer, "Keep the layer out: test the driver's own micromaps");
    takesWords(*command.add_option("--implementation", options.implementation,
                                   "Who implements micromaps, as the layer's setting of that name [auto]"),
               {"auto", "driver", "ext", "emulated"});
    addLayerPathOption(command, options.layerFolder);
    command.add_option("-j,--jobs", options.jobs, "Worker processes at a time [one for each processor, at most 4]")
        ->check(wholeBetween(1, 256))
        ->type_name("COUNT");
    command.add_option("--timeout", options.timeout, "Seconds after which a case counts as hung [60]")
        ->check(between(0.1, 86400))
        ->type_name("SECONDS");
    command.add_flag("--worker", options.worker, "")->group("");
}

void checkTogether(const CheckOptions &options)
{
    if (options.quick && options.minutes)
        throw UsageError("--quick and --minutes exclude each other");
    if (options.minutes && options.caseList)
        throw UsageError("--minutes makes new cases, so it takes no --caselist");
    if (options.quick && options.caseList)
        throw UsageError("--quick selects cases of its own, so it takes no --caselist");
    if (options.results)
        checkSuffix(*options.results, {".csv"});
    if (options.junit)
        checkSuffix(*options.junit, {".xml"});
    if (options.results && options.junit && locationOf(*options.results) == locationOf(*options.junit))
        throw UsageError("--results and --junit name the same file");
    if (!options.implementation.empty() && !options.layer)
        throw UsageError("--implementation is for the layer, which --no-layer does without");
}

// Throws UsageError for an option that is not among `taken`, with the reason in front.
void checkTaken(const CLI::App &command, const std::string &reason, std::initializer_list<std::string> taken)
{
    for (const CLI::Option *option : command.get_options())
        if (const std::string name = option->get_name(); option->count() != 0 && std::ranges::count(taken, name) == 0)
            throw UsageError(reason + ", so it takes no " + name);
}

} // namespace

std::function<int()> declareCheckCommand(CLI::App &app)
{
    const auto options = std::make_shared<CheckOptions>();
    options->jobs = std::clamp(std::thread::hardware_concurrency(), 1U, kMostJobs);
    CLI::App &command =
        *app.add_subcommand("check", "Tests the opacity micromaps of a Vulkan device with random cases");
    command.footer(kCheckDetails);
    declareSelection(command, *options);
    declareOutput(command, *options);
    declareDevice(command, *options);
    return [options, &command] {
        checkTogether(*options);
        if (!options->merge.empty())
            checkTaken(command, "--merge runs no cases",
                       {"--merge", "--output", "--force", "--results", "--junit", "--json", "--fail-on-flake"});
        if (options->replay)
            checkTaken(command, "--replay runs one case",
                       {"--replay", "--device", "--no-layer", "--implementation", "--layer-path", "--timeout"});
        return checkCommand(*options);
    };
}

} // namespace vellum::cli
