// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "base/error.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/files.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/sweep/sweep.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kSweepDetails = R"(
Shows what vellum bake would make of files with many settings, and writes none of them: automatic levels and each level up to
--max-level in 4 and in 2 states, and budgets from 1K on until they change nothing. For each there are the bytes of
micromaps, the share of the alpha-tested surface that is known, the bytes for each further percentage point, and the
expected shader calls. One setting is recommended, with the reason.

Of several files, bytes are added up, and the share is the mean of all files. A budget is that of each file. Each texture is
decoded once, each triangle is classified once for each level and twice for all budgets.

The page (.html) has the table and a chart, a .svg the chart alone. An existing file is replaced only if vellum wrote it, or
with --force.

Examples:
  vellum sweep tree.glb
      the table and the recommendation
  vellum sweep models/ -o sweep.html
      all .glb and .gltf files in models/, as a page
  vellum sweep tree.glb --max-level 12 --json
      finer levels than auto chooses by default
)";

void declareSweep(CLI::App &command, SweepOptions &options)
{
    command.footer(kSweepDetails);
    command.option_defaults()->group(kInput);
    command.add_option("IN", options.inputs, "glTF files (.glb, .gltf) or folders of them")
        ->type_name("IN...")
        ->required();
    command.option_defaults()->group(kOutput);
    command
        .add_option("-o,--output", options.output, "The page (.html) or the chart (.svg) to write, or - for the page")
        ->type_name("OUT");
    command.add_flag("--force", options.force, "Replace existing files, whoever wrote them");
    command.add_flag("--json", options.json, "Print the table as JSON, also for each file");
    command.option_defaults()->group(kGeneral);
    command.add_flag("-q,--quiet", options.quiet, "Print errors only");
    addThreadsOption(command, options.threads);
}

} // namespace

std::function<int()> declareSweepCommand(CLI::App &app)
{
    const auto options = std::make_shared<SweepOptions>();
    CLI::App &command = *app.add_subcommand("sweep", "Compares what settings of bake would make of glTF files");
    declareSweep(command, *options);
    const auto own = static_cast<ptrdiff_t>(command.get_options().size());
    const std::function<void()> finish = declareBaking(command, options->bake);
    for (const char *varied : {"--level", "--states", "--budget", "--target-known"})
        command.remove_option(command.get_option(varied));
    std::vector<CLI::Option *> baking = command.get_options();
    baking.erase(baking.begin(), baking.begin() + own);
    return [options, finish, baking] {
        finish();
        for (const CLI::Option *option : baking)
            for (const std::string &value : option->results())
                options->given +=
                    " " + option->get_name() + (option->get_expected_max() == 0 ? "" : " " + shellWord(value));
        if (options->json && options->output == "-")
            throw UsageError("--json and an output to stdout exclude each other");
        if (options->output) {
            checkSuffix(*options->output, {".html", ".htm", ".svg"});
            checkWritable(*options->output, options->force);
        }
        return sweepCommand(*options);
    };
}

} // namespace vellum::cli
