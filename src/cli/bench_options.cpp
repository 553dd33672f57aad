// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "cli/bench_command.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/render_command.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kBenchDetails = R"(
Measures opacity micromaps on a GPU, and writes a report to send: one web page, and the same data as JSON next to it.
First a self-check by random cases, then frames with micromaps compared with alpha tests, by ray queries and by ray
tracing pipelines; builds with the layer and without; and the creation of pipelines. If the driver has micromaps, they
are compared with emulated ones. Each part runs in a process of its own, with short submissions: if one hangs, crashes
or loses the device, the others continue. After Ctrl-C the report has the results so far. It names the device and its
driver, and nothing of the machine or its user.

Examples:
  vellum bench
      three minutes on the most powerful device; vellum-bench.html
  vellum bench --device 1 --seconds 600 -o reports/
      longer, another device
)";

} // namespace

std::function<int()> declareBenchCommand(CLI::App &app)
{
    const auto options = std::make_shared<BenchOptions>();
    CLI::App &command = *app.add_subcommand("bench", "Measures micromaps on a GPU, and writes a report to send");
    command.footer(kBenchDetails);
    command.option_defaults()->group(kOutput);
    command.add_option("-o,--output", options->output, "The page, or a folder for it [vellum-bench.html]")
        ->type_name("FILE");
    command.add_flag("--force", options->force, "Replace a file that vellum did not write");
    command.option_defaults()->group(kDevice);
    addDeviceOption(command, options->device.device);
    addLayerPathOption(command, options->device.layerFolder);
    command.option_defaults()->group(kSelection);
    command.add_option("--seconds", options->seconds, "How long it may take, about [180]")
        ->check(between(0.1, 86400))
        ->type_name("SECONDS");
    command
        .add_option("--timeout", options->timeout,
                    "The time without progress after which a part counts as hung and is ended; a slow one goes on [60]")
        ->check(between(0.1, 86400))
        ->type_name("SECONDS");
    command.add_option("--worker", options->worker, "")->group(""); // for its own processes
    return [options] { return !options->worker.empty() ? runPartWorker(options->device) : benchCommand(*options); };
}

} // namespace vellum::cli
