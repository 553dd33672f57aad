// SPDX-License-Identifier: Apache-2.0
// `vellum run`
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <memory>

#include "cli/base/error.h"
#include "cli/base/system/child_process.h"
#include "cli/base/system/files.h"
#include "cli/base/system/this_process.h"
#include "cli/info/manifests.h"
#include "cli/options/checks.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/help.h"
#include "cli/run/message_summary.h"
#include "cli/vulkan/layer_path.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

constexpr int kMessagesFailed = 122;
constexpr int kNotRun = 125;

constexpr const char *kRunDetails = R"(
Runs a program with the layer on, in it and in the processes that it starts, and prints how many errors and warnings the
layer reported, with the first message of each kind. What the program does with its output and its input is unchanged;
the summary is on stderr. Options come before the program, separated by --.

Messages: an error is input that the layer rejected, a warning one that it tolerated, or that probably has no effect.

Exit status:
  {}
  122       the program succeeded, but there were messages of the severity of --fail-on
  125       the program was not run: the layer is not found, or would be ignored
  126, 127  the program cannot be executed; there is no such program
  2         usage error

Environment:
  VELLUM_FAIL_ON
      error, warning or never, without --fail-on

Examples:
  vellum run -- ./viewer scene.glb
      fails if the program fails or the layer rejects something
  vellum run --fail-on warning --validate -- ./tests --gtest_filter='Rays.*'
      for continuous integration)";

struct RunOptions {
    std::vector<std::string> program;
    std::string failOn;
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

// Lets the loader find and load the layer in programs that inherit the environment.
void turnLayerOn(const std::optional<std::filesystem::path> &given)
{
    if (environmentIsIgnored())
        throw Error("programs that run as administrator ignore the variables that turn the layer on");
    const std::optional<std::filesystem::path> folder = given ? given : findLayerFolder();
    const std::vector<Manifest> manifests = findLayerManifests(folder.value_or(""));
    if (manifests.empty())
        throw Error("the layer is not found; name the folder of its manifest by --layer-path");
    if (folder)
        addLayerFolder(std::filesystem::absolute(*folder));
    const std::string others = variable("VK_INSTANCE_LAYERS").value_or("");
    const std::string separator(1, kListSeparator);
    if ((separator + others + separator).find(separator + kLayerName + separator) == std::string::npos)
        setVariable("VK_INSTANCE_LAYERS", kLayerName + (others.empty() ? "" : separator + others));
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

// Whether messages fail a program that succeeds.
bool fails(const MessageSummary &summary, const std::string &failOn)
{
    if (failOn == "never")
        return false;
    return summary.errors != 0 || (failOn == "warning" && summary.warnings != 0);
}

int run(const RunOptions &options, const std::vector<std::string> &commandLine)
{
    std::vector<std::string> words = wordsBehindSeparator(commandLine);
    if (words.empty())
        words = options.program;
    const TemporaryFile messages;
    try {
        turnLayerOn(options.layerFolder);
    } catch (const Error &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
        return kNotRun;
    }
    applySettings(options);
    setVariable("VELLUM_REPORT_FILE", utf8Text(messages.path()));
    const int code = runProgram(words);
    if (code == 126 || code == 127)
        return code;
    std::ifstream lines(messages.path());
    const MessageSummary summary = readMessages(lines);
    print(summary);
    if (code != 0 || !fails(summary, options.failOn))
        return code;
    std::fprintf(stderr, "vellum run: failed, because of messages of the layer (--fail-on %s)\n",
                 options.failOn.c_str());
    return kMessagesFailed;
}

} // namespace

std::function<int()> declareRunCommand(CLI::App &app, const std::vector<std::string> &words)
{
    const auto options = std::make_shared<RunOptions>();
    CLI::App &command =
        *app.add_subcommand("run", "Runs a program with the layer on, and fails if the layer reports errors");
    command.footer(fmt::format(kRunDetails, kExitCodesOfPrograms));
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
    command.option_defaults()->group("Layer");
    command.add_flag("--strict", options->strict, "Reject what breaks a rule even where it does no harm");
    command
        .add_flag("--validate{all}", options->validate,
                  "Check the rules of the extensions, all or those named: --validate=core,gpu,sync")
        ->type_name("PARTS");
    CLI::Option &implementation = *command.add_option("--implementation", options->implementation,
                                                      "Who implements micromaps: the driver where it has them, the "
                                                      "driver only, its EXT extension, or the layer [auto]");
    takesWords(implementation, {"auto", "driver", "ext", "emulated"});
    command.add_flag("--assume-micromaps", options->assumeMicromaps,
                     "Use micromaps in pipelines and ray queries that do not ask for them");
    command
        .add_option("--layer-path", options->layerFolder,
                    "Folder of the layer's manifest, instead of the one installed with this program")
        ->type_name("FOLDER");
    return [options, words] { return run(*options, words); };
}

} // namespace vellum::cli
