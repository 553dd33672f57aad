// SPDX-License-Identifier: Apache-2.0
// `vellum run`
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/process.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/base/variables.h"
#include "cli/info/manifests.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "gpu/layer_path.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kRunDetails = R"(
Runs a program with the layer on, in it and in the processes that it starts, and prints how many errors and warnings the
layer reported, with the first message of each kind. What the program does with its output and its input is unchanged;
the summary is on stderr. Options come before the program, separated by --.

Messages: an error is input that the layer rejected, a warning one that it tolerated, or that probably has no effect.

A device counts as checked once the program builds a micromap or an acceleration structure on it with --validate. Without
--require-checks, a program passes in which nothing was checked, which the summary states.

--junit writes a test case for the program, one for whether anything was checked, and one for each kind of message. Those
that do not fail the run are passed, with the message as output.

Examples:
  vellum run -- ./viewer scene.glb
      fails if the program fails or the layer rejects something
  vellum run --validate --fail-on warning --require-checks --junit micromaps.xml -- ./tests --gtest_filter='Rays.*'
      for continuous integration

Environment:
  VELLUM_FAIL_ON
      error, warning or never, without --fail-on
  VELLUM_REQUIRE_CHECKS
      1 is --require-checks
)";

struct RunOptions {
    std::vector<std::string> program;
    std::string failOn;
    bool requireChecks = false;
    std::optional<std::filesystem::path> junit;
    bool assumeMicromaps = false;
    std::string implementation; // empty: not given
    bool strict = false;
    std::string validate; // empty: not given
    std::optional<std::filesystem::path> layerFolder;
};

// The layer's messages of one run, as its setting report_file writes them.
enum class MessageSeverity { Info, Warning, Error };

struct MessageSummary {
    struct Kind {
        MessageSeverity severity;
        std::string id;
        std::string text; // of the first
        size_t count;
    };
    std::vector<Kind> kinds; // of warnings and errors, in the order of the first of each
    size_t errors = 0;
    size_t warnings = 0;
    size_t devices = 0; // devices with micromaps of the layer, or with its validation
    size_t checked = 0; // those on which builds were validated
};

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

std::string countOf(size_t count, const char *what)
{
    return fmt::format("{} {}{}", count == 0 ? "no" : std::to_string(count), what, count == 1 ? "" : "s");
}

MessageSummary readMessages(std::istream &lines)
{
    MessageSummary summary;
    for (std::string line; std::getline(lines, line);) {
        const std::optional<Message> message = parse(line);
        if (!message)
            continue;
        if (message->severity == MessageSeverity::Info) {
            summary.devices += message->id == "VELLUM-device" ? 1u : 0u;
            summary.checked += message->id == "VELLUM-checked" ? 1u : 0u;
            continue;
        }
        ++(message->severity == MessageSeverity::Error ? summary.errors : summary.warnings);
        const auto kind = std::ranges::find_if(summary.kinds, [&](const MessageSummary::Kind &k) {
            return k.severity == message->severity && k.id == message->id;
        });
        if (kind == summary.kinds.end())
            summary.kinds.push_back({message->severity, message->id, message->text, 1});
        else
            ++kind->count;
    }
    return summary;
}

std::string times(const MessageSummary::Kind &kind)
{
    return kind.count == 1 ? "" : fmt::format(" ({} times)", kind.count);
}

constexpr const char *kNotValidated = "not validated: add --validate";

// Why nothing was checked; empty if something was.
std::string whyUnchecked(const MessageSummary &summary)
{
    if (summary.checked != 0)
        return "";
    if (summary.devices == 0)
        return "no device used micromaps through the layer";
    // --validate sets the first one.
    for (const char *name : {"VELLUM_VALIDATE", "VK_VELLUM_VALIDATE", "VK_VELLUM_OPACITY_MICROMAP_VALIDATE"})
        if (const std::string parts = variable(name).value_or("none"); parts != "none" && !parts.empty())
            return "no micromap or acceleration structure was built on a device with validation";
    return kNotValidated;
}

// Prints to stderr.
void print(const MessageSummary &summary)
{
    if (const std::string why = whyUnchecked(summary); !why.empty())
        fmt::print(stderr, "vellum run: {}{}\n", why == kNotValidated ? "" : "nothing was checked: ", why);
    fmt::print(stderr, "vellum run: {}, {}, {} checked\n", countOf(summary.errors, "error"),
               countOf(summary.warnings, "warning"), countOf(summary.checked, "device"));
    for (const MessageSummary::Kind &kind : summary.kinds)
        fmt::print(stderr, "  {:<7} {}{}: {}\n", kind.severity == MessageSeverity::Error ? "error" : "warning", kind.id,
                   times(kind), kind.text);
}

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

// Lets the loader find and load the layer in programs that inherit the environment.
void turnLayerOn(const std::optional<std::filesystem::path> &given)
{
    if (environmentIsIgnored())
        throw Error("programs that run as administrator ignore the variables that turn the layer on");
    const std::optional<std::filesystem::path> folder = given ? given : gpu::findLayerFolder();
    const std::vector<Manifest> manifests = findLayerManifests(folder.value_or(""));
    if (manifests.empty())
        throw Error("the layer is not found; name the folder of its manifest by --layer-path");
    if (folder)
        gpu::addLayerFolder(std::filesystem::absolute(*folder));
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

bool fails(const MessageSummary::Kind &kind, const RunOptions &options)
{
    return options.failOn == "warning" || (options.failOn == "error" && kind.severity == MessageSeverity::Error);
}

// Why the layer's messages fail a program that succeeds; empty where they do not.
std::string failureOf(const MessageSummary &summary, const RunOptions &options)
{
    if (std::ranges::any_of(summary.kinds, [&](const MessageSummary::Kind &kind) { return fails(kind, options); }))
        return "because of messages of the layer (--fail-on " + options.failOn + ")";
    return options.requireChecks && summary.checked == 0 ? "because nothing was checked (--require-checks)" : "";
}

// JUnit's format: a test case for the program, one for its devices, and one for each kind of message.
std::string junitXml(const std::string &program, int code, double seconds, const MessageSummary &summary,
                     const RunOptions &options)
{
    std::string cases;
    size_t failures = 0;
    const auto add = [&](const std::string &name, bool failed, const std::string &text) {
        failures += failed ? 1u : 0u;
        const std::string shown = markupText(printable(text));
        cases += fmt::format("    <testcase classname=\"vellum.run\" name=\"{}\"", markupText(printable(name)));
        if (failed)
            cases += fmt::format("><failure message=\"{}\"/></testcase>\n", shown);
        else
            cases += text.empty() ? "/>\n" : fmt::format("><system-out>{}</system-out></testcase>\n", shown);
    };
    add("program", code != 0, code != 0 ? fmt::format("exit code {}", code) : "");
    const std::string unchecked = whyUnchecked(summary);
    add("checks", !unchecked.empty() && options.requireChecks, unchecked);
    for (const MessageSummary::Kind &kind : summary.kinds)
        add(kind.id, fails(kind, options), kind.text + times(kind));
    return fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"vellum run\">\n"
                       "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" time=\"{:.3f}\">\n{}  </testsuite>\n"
                       "</testsuites>\n",
                       markupText(printable(program)), summary.kinds.size() + 2, failures, seconds, cases);
}

bool writeJunit(const std::filesystem::path &path, const std::string &text)
{
    try {
        writeWhole(path, {reinterpret_cast<const uint8_t *>(text.data()), text.size()});
        return true;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
        return false;
    }
}

int run(const RunOptions &options, const std::vector<std::string> &commandLine)
{
    std::vector<std::string> words = wordsBehindSeparator(commandLine);
    if (words.empty())
        words = options.program;
    std::optional<TemporaryFile> messages;
    try {
        messages.emplace();
        turnLayerOn(options.layerFolder);
        applySettings(options);
        setVariable("VELLUM_REPORT_FILE", utf8Text(messages->path()));
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
        return static_cast<int>(ExitCode::NotRun);
    }
    const auto start = std::chrono::steady_clock::now();
    const int code = runProgram(words);
    const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - start;
    if (code == static_cast<int>(ExitCode::NotExecutable) || code == static_cast<int>(ExitCode::NoProgram))
        return code;
    std::ifstream lines(messages->path());
    const MessageSummary summary = readMessages(lines);
    print(summary);
    const std::string failure = failureOf(summary, options);
    if (options.junit &&
        !writeJunit(*options.junit, junitXml(words.front(), code, duration.count(), summary, options)) && code == 0 &&
        failure.empty())
        return static_cast<int>(ExitCode::Failed);
    if (code != 0 || failure.empty())
        return code;
    std::fprintf(stderr, "vellum run: failed, %s\n", failure.c_str());
    return static_cast<int>(ExitCode::MessagesFailed);
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
        ->envname("VELLUM_REQUIRE_CHECKS")
        ->group(kOutput);
    command.add_option("--junit", options->junit, "Write what was found here, in JUnit's format")
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
    command
        .add_option("--layer-path", options->layerFolder,
                    "Folder of the layer's manifest, instead of the one installed with this program")
        ->type_name("FOLDER");
    return [options, words] {
        if (options->junit)
            checkSuffix(*options->junit, {".xml"});
        // The program may never load the layer, which would report them.
        if (const std::vector<std::string> problems = misspeltVariables(); !problems.empty())
            throw UsageError(problems.front());
        return run(*options, words);
    };
}

} // namespace vellum::cli
