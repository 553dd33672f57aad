// SPDX-License-Identifier: Apache-2.0
#include "cli/check_command.h"

#include <algorithm>
#include <array>
#include <memory>
#include <thread>

#include "base/error.h"
#include "cli/base/files.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kCheckDetails = R"(
Tests a device's opacity micromaps, its own or those of the layer, with random cases of VK_KHR_opacity_micromap and
VK_EXT_opacity_micromap, whose results are compared with an oracle on the CPU. A case is named API.GROUP.NUMBER, such as
khr.resolution-query.0042; --seed and its name determine it. Cases run in processes of their own: a crash, a hang and a lost
device are results. A failure is run again in a new process; if it then passes, it is a flake.

FOLDER gets results.csv and failures.csv as deqp-runner writes them, junit.xml, results.json, and in failures/ the first
three failing cases of each cause as files for --replay, with what explains them.

The files of --baseline, --skips and --flakes are those of deqp-runner. A baseline has a line NAME,STATUS for each known
failure; an earlier failures.csv is one. Skips and flakes are regular expressions that match a part of a name, one a line;
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
    if (options.replay &&
        (options.list || options.quick || options.minutes || options.caseList || !options.filters.empty()))
        throw UsageError("--replay runs one case, so it takes no option that selects cases");
    if (options.results)
        checkSuffix(*options.results, {".csv"});
    if (options.junit)
        checkSuffix(*options.junit, {".xml"});
    if (!options.implementation.empty() && !options.layer)
        throw UsageError("--implementation is for the layer, which --no-layer does without");
}

// --merge takes the options of what is written only.
void checkMerge(const CLI::App &command)
{
    constexpr std::array kTaken = {"--merge", "--output", "--force", "--results", "--junit", "--json"};
    for (const CLI::Option *option : command.get_options())
        if (const std::string name = option->get_name(); option->count() != 0 && std::ranges::count(kTaken, name) == 0)
            throw UsageError("--merge runs no cases, so it takes no " + name);
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
            checkMerge(command);
        return checkCommand(*options);
    };
}

} // namespace vellum::cli
