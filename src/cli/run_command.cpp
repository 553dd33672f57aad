// SPDX-License-Identifier: Apache-2.0
// `vellum run`
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/process.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/info/loader_report.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/run/run_report.h"
#include "core/utf8_path.h"
#include "gpu/instance.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{
namespace
{

constexpr std::string_view kName = "VELLUM_";
// Before the keys of settings, the longest first.
constexpr std::array<std::string_view, 3> kPrefixes = {"VK_VELLUM_OPACITY_MICROMAP_", "VK_VELLUM_", kName};

// Of "VELLUM_VALIDTE": the name that was meant is near; the reason why nothing reads it. Others with the prefix may be
// another program's.
std::string problemOfKey(const std::string &name, std::string_view prefix)
{
    const auto isNear = [key = std::string_view(name).substr(prefix.size())](const std::string &known) {
        return isMisspelling(key, known);
    };
    return std::ranges::any_of(layer::variableKeys(prefix), isNear) ? layer::problemOfVariable(name, prefix)
                                                                    : std::string();
}

// The variable that was meant by one such as "VELUM_VALIDATE", "vellum_validate" or "VELLUM-VALIDATE", whose prefix is
// not that of settings; empty if it is another program's.
std::string meantByPrefix(const std::string &name)
{
    std::string text = layer::inCapitals(name);
    std::ranges::replace(text, '-', '_');
    const std::string start = text.starts_with("VK_") ? "VK_" : "";
    const size_t end = text.find('_', start.size());
    if (end == std::string::npos)
        return {};
    const std::string word = text.substr(start.size(), end + 1 - start.size());
    // A second wrong letter only where the first is right: HELIUM_ is another word.
    const size_t most = word.front() == kName.front() ? 2 : 1;
    if (editDistance(word, kName) > most)
        return {};
    const std::string prefix = start + std::string(kName);
    const std::string key = text.substr(end + 1);
    for (const std::string &known : layer::variableKeys(prefix))
        if (key == known || (word == kName && isMisspelling(key, known)))
            return prefix + known;
    return {};
}

// "there is no setting VELLUM_VALIDTE; did you mean VELLUM_VALIDATE?" for each variable of the environment whose name
// is nearly that of a setting, also if it is the prefix that is wrong (VELUM_VALIDATE). Others may be another
// program's.
std::vector<std::string> misspeltVariables()
{
    std::vector<std::string> problems;
    for (const std::string &name : variableNames()) {
        const auto *const prefix =
            std::ranges::find_if(kPrefixes, [&](std::string_view known) { return name.starts_with(known); });
        if (prefix != kPrefixes.end()) {
            if (std::string problem = problemOfKey(name, *prefix); !problem.empty())
                problems.push_back(std::move(problem));
            continue;
        }
        const std::string meant = meantByPrefix(name);
        // If it is set to the same, it is read. On Windows, it is the same variable in other letters.
        if (!meant.empty() && variable(meant.c_str()) != variable(name.c_str()))
            problems.push_back("nothing reads " + name + "; did you mean " + meant + "?");
    }
    return problems;
}

constexpr const char *kRequireChecks = "VELLUM_REQUIRE_CHECKS";

constexpr const char *kRunDetails = R"(
Runs a program with the layer on, in it and in the processes that it starts, and prints how many errors and warnings the
layer reported, with the first message of each kind. What the program does with its output and its input is unchanged;
the summary is on stderr. Options come before the program, separated by --.

Messages: an error is input that the layer rejected or, with --validate, that breaks a rule. A warning is
what probably has no effect and, without --validate, input that breaks a rule and was tolerated.

A device counts as checked once the program builds a micromap or an acceleration structure on it with --validate. Without
--require-checks, a program passes in which nothing was checked, which the summary states. With it, one checked device in
all processes together is enough. The summary names the parts of the validation, unless all were on. Processes that start
others without the variables of their environment, or that outlive the program, are not counted.

--junit writes a test case for the program, one for whether anything was checked, and one for each kind of message. Those
that do not fail the run are passed, with the message as output. --json writes the same, and more, for programs. A run in
which the program could not be started writes both as well, with a failure.

With --timeout, the program has a process group of its own, so that it cannot read from a terminal.

Examples:
  vellum run -- ./viewer scene.glb
      fails if the program fails or the layer rejects something
  vellum run --validate --fail-on warning --require-checks --junit micromaps.xml -- ./tests --gtest_filter='Rays.*'
      for continuous integration

Environment:
  VELLUM_FAIL_ON
      error, warning or never, without --fail-on
  VELLUM_REQUIRE_CHECKS
      1, true, on or yes is --require-checks; 0, false, off or no is not
)";

struct RunOptions {
    std::vector<std::string> program;
    std::string failOn;
    bool requireChecks = false;
    std::vector<std::string> ignored; // ids of messages
    std::optional<double> timeout;    // seconds
    std::optional<std::filesystem::path> junit;
    std::optional<std::filesystem::path> json;
    bool assumeMicromaps = false;
    std::string implementation; // empty: not given
    bool strict = false;
    std::string validate; // empty: not given
    std::optional<std::filesystem::path> layerFolder;
};

// The words behind "--", as they are: the library of the command line splits words like "[a,b]".
std::vector<std::string> wordsBehindSeparator(const std::vector<std::string> &words)
{
    const auto separator = std::find(words.begin(), words.end(), "--");
    return {separator == words.end() ? separator : separator + 1, words.end()};
}

// The values of the layer's setting `validate`.
CLI::Validator partsOfValidation()
{
    return CLI::Validator(
        [](std::string &text) {
            const std::vector<std::string> parts = {"core", "gpu", "sync", "all", "none"};
            for (size_t at = 0; at <= text.size();) {
                const size_t end = std::min(text.find(',', at), text.size());
                const std::string part = text.substr(at, end - at);
                if (std::ranges::find(parts, part) == parts.end())
                    return fmt::format("must be core, gpu, sync, several of them with commas, all or none, got {}{}",
                                       text, suggestion(part, parts));
                at = end + 1;
            }
            return std::string();
        },
        "");
}

// Lets the loader find and load the layer in programs that inherit the environment. Throws Error where it would pass
// over the layer.
void turnLayerOn(const std::optional<std::filesystem::path> &given)
{
    if (environmentIsIgnored())
        throw Error("programs that run as administrator ignore the variables that turn the layer on");
    const std::optional<std::filesystem::path> folder = given ? given : gpu::findLayerFolder();
    if (findLayerManifests(folder.value_or("")).empty())
        throw Error("the layer is not found; name the folder of its manifest by --layer-path");
    if (folder)
        gpu::addLayerFolder(std::filesystem::absolute(*folder));
    // The first is the one that the loader takes.
    const std::vector<Manifest> manifests = findLayerManifests("");
    if (!manifests.empty() && !manifests.front().problem.empty())
        throw Error("the layer's manifest " + utf8Text(manifests.front().path) + ": " + manifests.front().problem);
    const std::string others = variable("VK_INSTANCE_LAYERS").value_or("");
    const std::string separator(1, kListSeparator);
    if ((separator + others + separator).find(separator + gpu::kLayerName + separator) == std::string::npos)
        setVariable("VK_INSTANCE_LAYERS", gpu::kLayerName + (others.empty() ? "" : separator + others));
}

void applySettings(const RunOptions &options)
{
    const std::pair<const char *, bool> settings[] = {
        {"VELLUM_ASSUME_MICROMAPS", options.assumeMicromaps},
        {"VELLUM_STRICT", options.strict},
    };
    for (const auto &[name, on] : settings)
        if (on)
            setVariable(name, "1");
    if (!options.implementation.empty())
        setVariable("VELLUM_IMPLEMENTATION", options.implementation);
    if (!options.validate.empty())
        setVariable("VELLUM_VALIDATE", options.validate);
    if (!variable("VELLUM_MESSAGE_LIMIT"))
        setVariable("VELLUM_MESSAGE_LIMIT", "0"); // every message is counted
}

// Returns false after a line on stderr, unless `quiet`.
bool writeFile(const std::optional<std::filesystem::path> &path, const std::string &text, bool quiet)
{
    try {
        if (path)
            writeWhole(*path, text);
        return true;
    } catch (const std::exception &error) {
        if (!quiet)
            std::fprintf(stderr, "vellum: %s\n", error.what());
        return false;
    }
}

// Writes the files of the options. If one cannot be written, a run that succeeded fails.
void writeReports(const RunOptions &options, RunReport &report, bool quiet = false)
{
    const auto write = [&](const std::optional<std::filesystem::path> &path, const std::string &text) {
        if (!writeFile(path, text, quiet) && report.exitCode == 0)
            report.exitCode = static_cast<int>(ExitCode::Failed);
    };
    write(options.junit, junitXml(report));
    write(options.json, reportJson(report)); // it states the exit code
}

int exitWithoutRun(const RunOptions &options, RunReport &report, int code, const std::string &why)
{
    report.ended = true;
    report.notRun = why;
    report.exitCode = code;
    std::fprintf(stderr, "vellum: %s\n", why.c_str());
    writeReports(options, report);
    return code;
}

// Why the environment is not one for a run; empty if it is. The program may never load the layer, which would report
// misspelt variables.
std::string problemOfVariables(RunReport &report)
{
    if (const std::vector<std::string> problems = misspeltVariables(); !problems.empty())
        return problems.front();
    const std::string required = variable(kRequireChecks).value_or("");
    const std::optional<bool> isRequired = required.empty() ? false : layer::booleanOf(required);
    if (!isRequired)
        return std::string(kRequireChecks) + " is \"" + required + "\" and must be " + layer::kBooleanWords;
    report.requireChecks |= *isRequired;
    return {};
}

int run(const RunOptions &options, const std::vector<std::string> &commandLine)
{
    RunReport report;
    report.program = wordsBehindSeparator(commandLine);
    if (report.program.empty())
        report.program = options.program;
    for (const auto &file : {options.junit, options.json})
        if (file && isStandardStream(*file))
            throw UsageError("--junit and --json need files: stdout is the program's");
    if (options.junit && options.json && locationOf(*options.junit) == locationOf(*options.json))
        throw UsageError("--junit and --json name the same file");
    report.failOn = options.failOn;
    report.requireChecks = options.requireChecks;
    report.ignored = options.ignored;
    report.ended = false;
    // A run that is killed leaves these; the end of this one reports what cannot be written.
    writeReports(options, report, true);
    if (const std::string problem = problemOfVariables(report); !problem.empty())
        return exitWithoutRun(options, report, static_cast<int>(ExitCode::Usage), problem);
    std::optional<TemporaryFile> messages;
    try {
        messages.emplace();
        turnLayerOn(options.layerFolder);
        applySettings(options);
        setVariable("VELLUM_REPORT_FILE", utf8Text(messages->path()));
    } catch (const std::exception &error) {
        return exitWithoutRun(options, report, static_cast<int>(ExitCode::NotRun), error.what());
    }
    const auto start = std::chrono::steady_clock::now();
    report.end = runProgram(report.program, options.timeout);
    report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!report.end.started)
        return exitWithoutRun(options, report, report.end.code, report.end.text);
    if (report.end.timedOut)
        report.end.text = fmt::format("did not end within {} s", *options.timeout);
    report.ended = true;
    std::ifstream lines(messages->path());
    report.messages = readMessages(lines, options.ignored);
    print(report);
    const std::string failure = report.failure();
    report.exitCode =
        report.end.code != 0 || failure.empty() ? report.end.code : static_cast<int>(ExitCode::MessagesFailed);
    writeReports(options, report);
    if (report.end.code == 0 && !failure.empty())
        std::fprintf(stderr, "vellum run: failed, %s\n", failure.c_str());
    return report.exitCode;
}

} // namespace

std::function<int()> declareRunCommand(CLI::App &app, const std::vector<std::string> &words)
{
    const auto options = std::make_shared<RunOptions>();
    CLI::App &command =
        *app.add_subcommand("run", "Runs a program with the layer on, and fails if the layer reports errors");
    command.footer(kRunDetails);
    command.add_option("PROGRAM", options->program, "The program and its arguments")
        ->type_name("-- PROGRAM [ARGUMENT]...")
        ->group(kInput)
        ->required();
    options->failOn = "error";
    CLI::Option &failOn = *command.add_option(
        "--fail-on", options->failOn,
        "Least severity of messages that fail a program that succeeds [VELLUM_FAIL_ON, or else error]");
    takesWords(failOn, {"error", "warning", "never"});
    failOn.envname("VELLUM_FAIL_ON")->group(kOutput);
    command
        .add_flag("--require-checks", options->requireChecks,
                  "Fail if nothing was checked: the program built nothing on a device with micromaps and validation")
        ->group(kOutput);
    command.add_option("--ignore", options->ignored, "Messages with this id do not fail the run; repeatable")
        ->type_name("ID")
        ->allow_extra_args(false) // one id each: the program follows
        ->take_all()
        ->group(kOutput);
    command
        .add_option("--timeout", options->timeout,
                    "End the program, and the processes that it started, after this time")
        ->check(between(0.001, 1e6))
        ->type_name("SECONDS")
        ->group(kOutput);
    command.add_option("--junit", options->junit, "Write what was found here, in JUnit's format")
        ->type_name("FILE")
        ->group(kOutput);
    command.add_option("--json", options->json, "Write what was found here, as JSON")
        ->type_name("FILE")
        ->group(kOutput);
    command.option_defaults()->group("Layer");
    command.add_flag("--strict", options->strict, "Reject what breaks a rule even where it does no harm");
    command
        .add_flag("--validate{all}", options->validate,
                  "Check the rules of the extensions, all or those named: --validate=core,gpu,sync")
        ->type_name("PARTS")
        ->check(partsOfValidation());
    CLI::Option &implementation = *command.add_option("--implementation", options->implementation,
                                                      "Who implements micromaps: the driver where it has them, the "
                                                      "driver only, its EXT extension, or the layer [auto]");
    takesWords(implementation, {"auto", "driver", "ext", "emulated"});
    command.add_flag("--assume-micromaps", options->assumeMicromaps,
                     "Use micromaps in pipelines and ray queries that do not enable them");
    addLayerPathOption(command, options->layerFolder);
    return [options, words] {
        if (options->junit)
            checkSuffix(*options->junit, {".xml"});
        if (options->json)
            checkSuffix(*options->json, {".json"});
        return run(*options, words);
    };
}

} // namespace vellum::cli
