// SPDX-License-Identifier: Apache-2.0
// `vellum run`
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <istream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/json_writer.h"
#include "base/process.h"
#include "base/text.h"
#include "base/version.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/info/loader_report.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "gpu/instance.h"
#include "inspect/report_parts.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{
namespace
{

// The layer's messages of one run, as its setting report_file writes them.
enum class MessageSeverity { Info, Warning, Error };

struct MessageSummary {
    struct Kind {
        MessageSeverity severity;
        std::string id;
        std::string text; // of the first
        size_t count;
        bool ignored = false; // by --ignore
    };
    std::vector<Kind> kinds;        // of warnings and errors, in the order of the first of each
    size_t instances = 0;           // Vulkan instances with the layer
    bool validated = false;         // one of them had validation
    size_t devices = 0;             // devices with micromaps of the layer, or with its validation
    size_t plainDevices = 0;        // devices on which the layer does nothing
    bool driversOwn = false;        // one of these has micromaps of the driver
    size_t checked = 0;             // devices on which builds were validated
    std::vector<std::string> parts; // of validation on these, "core, gpu", each set once

    // Without those that are ignored.
    [[nodiscard]] size_t count(MessageSeverity severity) const;
    [[nodiscard]] size_t ignored() const;
    // "core only": where parts of the validation were off; empty if all were on.
    [[nodiscard]] std::string partsInWords() const;
    // Why nothing was checked; empty if something was.
    [[nodiscard]] std::string whyUnchecked() const;
};

// A run, whole or not.
struct RunReport {
    std::vector<std::string> program; // its words
    std::string failOn;               // the option
    bool requireChecks = false;
    std::vector<std::string> ignored; // ids of --ignore
    std::string notRun;               // why the program was not run; empty if it was
    bool ended = true;
    ProgramEnd end;
    double seconds = 0;
    MessageSummary messages;
    int exitCode = 0; // of `vellum run`

    [[nodiscard]] bool fails(const MessageSummary::Kind &kind) const;
    // Why the layer's messages fail a program that succeeds; empty where they do not.
    [[nodiscard]] std::string failure() const;
    // Ids of --ignore that no message had.
    [[nodiscard]] std::vector<std::string> staleIgnores() const;
    // "no such message", with the id that was meant, if the run has it.
    [[nodiscard]] std::string whyStale(const std::string &id) const;
};

// All parts of validation, as the layer writes them.
const std::string &allParts()
{
    struct All {
#define VELLUM_MEMBER(name, member, label, description) bool member = true;
        VELLUM_CHECKS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
    };
    static const std::string parts = layer::namesOf(All());
    return parts;
}

struct Message {
    MessageSeverity severity;
    std::string id;
    std::string text;
};

// "<severity> <id>: <text>"; nothing for a line that is cut off.
std::optional<Message> parse(const std::string &line)
{
    const size_t space = line.find(' ');
    const size_t colon = line.find(": ");
    if (space == std::string::npos || colon == std::string::npos || colon < space)
        return std::nullopt;
    const std::string severity = line.substr(0, space);
    Message message{MessageSeverity::Info, line.substr(space + 1, colon - space - 1), line.substr(colon + 2)};
    if (severity == "error")
        message.severity = MessageSeverity::Error;
    else if (severity == "warning")
        message.severity = MessageSeverity::Warning;
    else if (severity != "info")
        return std::nullopt;
    return message;
}

// What follows the last ": " of a message, without the process at its end: "core, gpu".
std::string valueOf(const std::string &text)
{
    const size_t colon = text.rfind(": ");
    const std::string value = colon == std::string::npos ? text : text.substr(colon + 2);
    return value.substr(0, value.rfind(" ["));
}

void addInfo(const Message &message, MessageSummary &summary)
{
    if (message.id == "VELLUM-instance") {
        ++summary.instances;
        summary.validated |= valueOf(message.text) != "none";
    } else if (message.id == "VELLUM-device") {
        ++summary.devices;
    } else if (message.id == "VELLUM-device-unchanged") {
        ++summary.plainDevices;
        summary.driversOwn |= message.text.starts_with("the driver's");
    } else if (message.id == "VELLUM-checked") {
        ++summary.checked;
        if (const std::string parts = valueOf(message.text);
            std::ranges::find(summary.parts, parts) == summary.parts.end())
            summary.parts.push_back(parts);
    }
}

std::string countOf(size_t count, const char *what)
{
    return fmt::format("{} {}{}", count == 0 ? "no" : std::to_string(count), what, count == 1 ? "" : "s");
}

const char *nameOf(MessageSeverity severity)
{
    return severity == MessageSeverity::Error ? "error" : "warning";
}

// "1 device checked (core only)"
std::string checkedDevices(const MessageSummary &messages)
{
    const std::string parts = messages.partsInWords();
    return countOf(messages.checked, "device") + " checked" + (parts.empty() ? "" : " (" + parts + ")");
}

// " (2 times, ignored)"
std::string remarksOn(const MessageSummary::Kind &kind)
{
    std::string text = kind.count == 1 ? "" : fmt::format("{} times", kind.count);
    if (kind.ignored)
        text += text.empty() ? "ignored" : ", ignored";
    return text.empty() ? text : " (" + text + ")";
}

size_t MessageSummary::count(MessageSeverity severity) const
{
    size_t sum = 0;
    for (const Kind &kind : kinds)
        sum += !kind.ignored && kind.severity == severity ? kind.count : 0;
    return sum;
}

size_t MessageSummary::ignored() const
{
    size_t sum = 0;
    for (const Kind &kind : kinds)
        sum += kind.ignored ? kind.count : 0;
    return sum;
}

std::string MessageSummary::partsInWords() const
{
    if (parts.empty() || (parts.size() == 1 && parts.front() == allParts()))
        return {};
    std::string text;
    for (const std::string &part : parts)
        text += (text.empty() ? "" : "; ") + part + (part == allParts() ? "" : " only");
    return text;
}

std::string MessageSummary::whyUnchecked() const
{
    if (checked != 0)
        return "";
    if (instances == 0 && devices == 0)
        return "no Vulkan instance was created with the layer: the program did not use Vulkan, found no driver (vellum "
               "info), or the variables of vellum run did not reach it or the loader (VK_LOADER_LAYERS_DISABLE)";
    if (devices == 0 && plainDevices == 0)
        return "no Vulkan device was created";
    if (devices == 0 && !driversOwn)
        return "no device enables an extension of opacity micromaps";
    if (devices == 0)
        return "micromaps are the driver's own, and validation is off";
    return validated ? "no micromap or acceleration structure was built on a device with validation"
                     : "validation is off";
}

// `ignored`: the ids of --ignore.
MessageSummary readMessages(std::istream &lines, const std::vector<std::string> &ignored)
{
    MessageSummary summary;
    for (std::string line; std::getline(lines, line);) {
        const std::optional<Message> message = parse(line);
        if (!message)
            continue;
        if (message->severity == MessageSeverity::Info) {
            addInfo(*message, summary);
            continue;
        }
        const auto kind = std::ranges::find_if(summary.kinds, [&](const MessageSummary::Kind &k) {
            return k.severity == message->severity && k.id == message->id;
        });
        if (kind != summary.kinds.end())
            ++kind->count;
        else
            summary.kinds.push_back({message->severity, message->id, message->text, 1,
                                     std::ranges::find(ignored, message->id) != ignored.end()});
    }
    return summary;
}

bool RunReport::fails(const MessageSummary::Kind &kind) const
{
    return !kind.ignored && (failOn == "warning" || (failOn == "error" && kind.severity == MessageSeverity::Error));
}

std::string RunReport::failure() const
{
    if (std::ranges::any_of(messages.kinds, [&](const MessageSummary::Kind &kind) { return fails(kind); }))
        return "because of messages of the layer (--fail-on " + failOn + ")";
    return requireChecks && messages.checked == 0 ? "because nothing was checked (--require-checks)" : "";
}

std::vector<std::string> RunReport::staleIgnores() const
{
    std::vector<std::string> stale;
    for (const std::string &id : ignored)
        if (std::ranges::find(messages.kinds, id, &MessageSummary::Kind::id) == messages.kinds.end())
            stale.push_back(id);
    return stale;
}

std::string RunReport::whyStale(const std::string &id) const
{
    // Not by letters: the numbers of other rules are near.
    for (const MessageSummary::Kind &kind : messages.kinds)
        if (kind.id == "VELLUM-" + id || id == "VELLUM-" + kind.id)
            return "no such message; did you mean " + kind.id + "?";
    return "no such message";
}

// Prints to stderr.
void print(const RunReport &report)
{
    const MessageSummary &messages = report.messages;
    std::string text;
    if (report.end.code != 0)
        text += fmt::format("vellum run: the program {}\n", report.end.text);
    if (const std::string why = messages.whyUnchecked(); !why.empty())
        text += fmt::format("vellum run: {}\n", messages.devices != 0 && !messages.validated
                                                    ? "not validated: add --validate"
                                                    : "nothing was checked: " + why);
    text += fmt::format("vellum run: {}, {}, {}{}\n", countOf(messages.count(MessageSeverity::Error), "error"),
                        countOf(messages.count(MessageSeverity::Warning), "warning"),
                        messages.ignored() == 0 ? "" : countOf(messages.ignored(), "message") + " ignored, ",
                        checkedDevices(messages));
    for (const MessageSummary::Kind &kind : messages.kinds)
        text += fmt::format("  {:<7} {}{}: {}\n", nameOf(kind.severity), kind.id, remarksOn(kind), kind.text);
    for (const std::string &id : report.staleIgnores())
        text += fmt::format("vellum run: --ignore {}: {}\n", id, report.whyStale(id));
    std::fputs(text.c_str(), stderr); // fmt::print() throws where nothing can be written
}

// JUnit's format: a test case for the program, one for its devices, and one for each kind of message.
std::string junitXml(const RunReport &report)
{
    std::string cases;
    size_t tests = 0;
    size_t failures = 0;
    const auto add = [&](const std::string &name, bool failed, const std::string &text) {
        ++tests;
        failures += failed ? 1u : 0u;
        const std::string shown = markupText(printable(text));
        cases += fmt::format("    <testcase classname=\"vellum.run\" name=\"{}\"", markupText(printable(name)));
        if (failed)
            cases += fmt::format("><failure message=\"{}\"/></testcase>\n", shown);
        else
            cases += text.empty() ? "/>\n" : fmt::format("><system-out>{}</system-out></testcase>\n", shown);
    };
    if (!report.ended) {
        add("program", true, "the run has not ended");
    } else if (!report.notRun.empty()) {
        add("program", true, "not run: " + report.notRun);
    } else {
        add("program", report.end.code != 0, report.end.code != 0 ? report.end.text : "");
        const std::string unchecked = report.messages.whyUnchecked();
        const bool inPart = !report.messages.partsInWords().empty();
        add("checks", !unchecked.empty() && report.requireChecks, inPart ? checkedDevices(report.messages) : unchecked);
        for (const MessageSummary::Kind &kind : report.messages.kinds)
            add(kind.id, report.fails(kind),
                (kind.ignored ? "ignored: " : "") + kind.text +
                    (kind.count == 1 ? "" : fmt::format(" ({} times)", kind.count)));
        for (const std::string &id : report.staleIgnores())
            add("--ignore " + id, false, report.whyStale(id));
    }
    return fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"vellum run\">\n"
                       "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" time=\"{:.3f}\">\n{}  </testsuite>\n"
                       "</testsuites>\n",
                       markupText(printable(report.program.front())), tests, failures, report.seconds, cases);
}

// src/cli/schema.json describes it.
std::string reportJson(const RunReport &report)
{
    JsonWriter json;
    beginReport(json, "run");
    json.member("version", versionText()).values("program", report.program);
    if (!report.ended)
        json.member("incomplete", "the run has not ended");
    else
        json.member("exitCode", report.exitCode);
    if (!report.notRun.empty())
        json.member("notRun", report.notRun);
    if (report.ended && report.notRun.empty()) {
        const MessageSummary &messages = report.messages;
        json.key("programEnd").beginObject().member("code", report.end.code).member("text", report.end.text);
        if (!report.end.signal.empty())
            json.member("signal", report.end.signal);
        json.member("timedOut", report.end.timedOut).end();
        json.member("seconds", report.seconds);
        if (const std::string failure = report.failure(); report.end.code == 0 && !failure.empty())
            json.member("failure", failure);
        json.member("instances", messages.instances).member("devices", messages.devices);
        json.member("unchangedDevices", messages.plainDevices).member("checkedDevices", messages.checked);
        json.list("validation", messages.parts, [&](const std::string &parts) {
            json.beginArray();
            for (std::string part : partsOf(parts, ',')) {
                part.erase(0, part.find_first_not_of(' '));
                json.value(part);
            }
            json.end();
        });
        if (const std::string why = messages.whyUnchecked(); !why.empty())
            json.member("unchecked", why);
        json.member("errors", messages.count(MessageSeverity::Error));
        json.member("warnings", messages.count(MessageSeverity::Warning)).member("ignored", messages.ignored());
        json.list("messages", messages.kinds, [&](const MessageSummary::Kind &kind) {
            json.beginObject().member("severity", nameOf(kind.severity)).member("id", kind.id);
            json.member("count", kind.count).member("text", kind.text);
            json.member("ignored", kind.ignored).member("fails", report.fails(kind)).end();
        });
        json.values("staleIgnores", report.staleIgnores());
    }
    return json.end().text() + "\n";
}

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

constexpr const char *kFailOn = "VELLUM_FAIL_ON";
constexpr const char *kRequireChecks = "VELLUM_REQUIRE_CHECKS";
const std::vector<std::string> kSeverities = {"error", "warning", "never"}; // of --fail-on

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
    std::string failOn; // empty: not given
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
    if (report.failOn.empty())
        report.failOn = variable(kFailOn).value_or("");
    if (report.failOn.empty())
        report.failOn = kSeverities.front();
    if (std::ranges::find(kSeverities, report.failOn) == kSeverities.end())
        return fmt::format("{} is \"{}\" and must be error, warning or never{}", kFailOn, report.failOn,
                           suggestion(report.failOn, kSeverities));
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
    CLI::Option &failOn = *command.add_option(
        "--fail-on", options->failOn,
        "Least severity of messages that fail a program that succeeds [VELLUM_FAIL_ON, or else error]");
    takesWords(failOn, kSeverities);
    failOn.group(kOutput);
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
