// SPDX-License-Identifier: Apache-2.0
// `vellum bench`
#include <chrono>
#include <fmt/format.h>
#include <memory>
#include <rapidjson/document.h>

#include "base/error.h"
#include "base/process.h"
#include "base/progress.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/bench/bench_report.h"
#include "cli/bench/part.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"

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

struct BenchOptions {
    std::optional<std::filesystem::path> output; // the page; the JSON is in the same folder
    BenchDevice device;
    double seconds = 180; // of all parts together
    double timeout = 60;  // without progress, after which a part counts as hung
    bool force = false;   // replaces any file
    std::string worker;   // a process of another one: its part, for who reads lists of processes
};

// Measures, prints the verdict on stdout, and writes the report. Returns the exit code.
int benchCommand(const BenchOptions &options);

// Facts about the device that a part found; empty if the part failed.
struct Found {
    std::string name;
    std::string ext = "none", khr = "none";
    bool rayQueries = false, rayTracingPipelines = false;
};

Found foundBy(const PartResult &result)
{
    Found found;
    if (result.rows.empty())
        return found;
    rapidjson::Document row;
    row.Parse(result.rows.front().data(), result.rows.front().size());
    if (row.HasParseError())
        return found;
    found.name = row["name"].GetString();
    found.ext = row["VK_EXT_opacity_micromap"].GetString();
    found.khr = row["VK_KHR_opacity_micromap"].GetString();
    found.rayQueries = row["rayQueries"].GetBool();
    found.rayTracingPipelines = row["rayTracingPipelines"].GetBool();
    return found;
}

// Who implements micromaps for the device, and by which extension.
struct Implementation {
    const char *setting; // of the layer
    gpu::Api api;
};

// The parts that measure, with the seconds of each. The self-check is first: of a wrong device no time matters.
std::vector<Part> measuringParts(const std::vector<Implementation> &implementations, const Found &device,
                                 double seconds)
{
    struct Share {
        PartKind kind;
        render::Trace trace;
        double part;
    };
    constexpr Share kShares[] = {{PartKind::Check, render::Trace::Query, 1},
                                 {PartKind::Frames, render::Trace::Query, 4},
                                 {PartKind::Frames, render::Trace::Pipeline, 4},
                                 {PartKind::Builds, render::Trace::Query, 2},
                                 {PartKind::Pipelines, render::Trace::Query, 1}};
    std::vector<Part> parts;
    double all = 0;
    for (const Share &share : kShares) {
        const bool traces = share.trace == render::Trace::Query ? device.rayQueries : device.rayTracingPipelines;
        if (share.kind == PartKind::Frames && !traces)
            continue;
        for (const Implementation &one : implementations) {
            parts.push_back({share.kind, one.setting, one.api, share.trace, share.part});
            all += share.part;
        }
    }
    for (Part &part : parts)
        part.seconds *= seconds / all;
    return parts;
}

class Run
{
public:
    explicit Run(const BenchOptions &options) : options_(options) {}

    // The implementations that exist for the device.
    std::vector<Implementation> findImplementations()
    {
        std::vector<Implementation> implementations;
        const Found emulated = describe("emulated");
        device_ = emulated;
        fmt::print("Device: {}\n", emulated.name);
        std::fflush(stdout);
        if (emulated.khr == "emulated")
            implementations.push_back({"emulated", gpu::Api::Khr});
        if (describe("ext").khr == "translated")
            implementations.push_back({"ext", gpu::Api::Khr});
        const Found own = describe("driver");
        if (device_.name.empty())
            device_ = own;
        if (own.khr == "driver")
            implementations.push_back({"driver", gpu::Api::Khr});
        else if (own.ext == "driver")
            implementations.push_back({"driver", gpu::Api::Ext});
        return implementations;
    }
    void measure(const std::vector<Implementation> &implementations)
    {
        const std::vector<Part> parts =
            measuringParts(implementations, device_, std::max(options_.seconds - elapsed(), 10.0));
        for (const Part &part : parts) {
            if (Interruptible::interrupted())
                return;
            ProgressLine progress(fmt::format("vellum bench: {}", part.name()));
            results_.push_back(runPartProcess(part, options_.device, options_.timeout, [&] {
                progress.update(static_cast<size_t>(elapsed()), static_cast<size_t>(options_.seconds) + 1);
            }));
        }
    }
    [[nodiscard]] const std::vector<PartResult> &results() const { return results_; }
    [[nodiscard]] double elapsed() const
    {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    }

private:
    Found describe(const char *implementation)
    {
        const Part part{PartKind::Device, implementation, gpu::Api::Khr, render::Trace::Query, 5};
        PartResult result = runPartProcess(part, options_.device, options_.timeout, [] {});
        if (result.rows.empty() && results_.empty())
            throw Error("no device can be measured: " + result.failure);
        const Found found = foundBy(result);
        if (results_.empty())
            results_.push_back(std::move(result)); // the device is the same for all
        return found;
    }

    const BenchOptions &options_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    Found device_;
    std::vector<PartResult> results_;
};

// Measures, prints the verdict on stdout, and writes the report. Returns the exit code.
int benchCommand(const BenchOptions &options)
{
    const std::filesystem::path page = outputFor(options.output, "vellum-bench.html");
    std::filesystem::path data = page;
    data.replace_extension(".json");
    if (isStandardStream(page))
        throw UsageError("--output is a web page or a folder for it, not stdout");
    checkSuffix(page, {".html", ".htm"});
    checkWritable(page, options.force);
    checkWritable(data, options.force);
    Run run(options);
    const std::vector<Implementation> implementations = run.findImplementations();
    if (implementations.empty())
        throw Error("the device cannot have micromaps: vellum info says why");
    const Interruptible interruptible;
    run.measure(implementations);
    const std::vector<std::string> verdict = verdictOf(run.results());
    const std::string json = benchJson(run.results(), verdict, run.elapsed());
    writeWhole(data, json);
    writeWhole(page, benchPage(json));
    bool complete = selfChecksPassed(run.results());
    for (const PartResult &result : run.results())
        complete = complete && result.failure.empty();
    for (const std::string &sentence : verdict)
        fmt::print("{}\n", sentence);
    fmt::print("Report: {}, {}\n", utf8Text(page), utf8Text(data));
    if (Interruptible::interrupted()) {
        std::fflush(stdout);
        Interruptible::die();
    }
    return static_cast<int>(complete ? ExitCode::Success : ExitCode::Failed);
}

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
