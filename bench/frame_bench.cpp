// SPDX-License-Identifier: Apache-2.0
// vellum-bench: what micromaps cost and save on this machine, as Markdown.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fmt/format.h>

#include "api_bench.h"
#include "base/progress.h"
#include "cli/bench/timing.h"
#include "cli/render_command.h"
#include "gpu/instance.h"
#include "scene_bench.h"

namespace
{

using namespace vellum;

struct Options {
    std::vector<std::filesystem::path> files;
    std::vector<std::string> parts = {"queries", "pipelines", "creation", "apis"};
    std::string size = "640x360";
    unsigned repetitions = 5;
    std::vector<uint32_t> levels = {3, 5, 7};
    std::vector<uint32_t> instances = {1, 9};
    gpu::Api api = gpu::Api::Khr;
    std::optional<std::string> device;
    std::optional<std::filesystem::path> layerFolder;
};

const char *nameOf(render::Trace trace)
{
    return trace == render::Trace::Query ? "query" : "pipeline";
}

struct Row {
    std::string name;
    render::Trace trace;
    uint32_t instances;
    bench::SceneResult result;
};

void printLevels(const std::vector<Row> &rows)
{
    fmt::print(
        "| scene | copies | rays by | level | micromap bytes | unknown | candidates/ray alpha | candidates/ray omm "
        "| time omm/alpha | heavy omm/alpha |\n|---|--:|---|--:|--:|--:|--:|--:|--:|--:|\n");
    for (const Row &row : rows)
        for (const bench::LevelResult &l : row.result.levels)
            fmt::print("| {} | {} | {} | {} | {} | {:.1f} % | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", row.name,
                       row.instances, nameOf(row.trace), l.level, l.bytes, 100 * l.unknown, row.result.candidatesPerRay,
                       l.candidatesPerRay, l.plainRatio, l.heavyRatio);
    fmt::print("\nAim for pipelines at levels 5 to 7: at most 0.97, heavy at most 0.80.\n\n");
}

void printScenes(const std::vector<Row> &rows)
{
    fmt::print(
        "| scene | copies | rays by | alpha, ms | heavy alpha, ms | without micromaps: extension enabled / layer "
        "off |\n|---|--:|---|--:|--:|--:|\n");
    for (const Row &row : rows)
        fmt::print("| {} | {} | {} | {:.1f} | {:.1f} | {:.3f} |\n", row.name, row.instances, nameOf(row.trace),
                   row.result.alphaMilliseconds, row.result.heavyMilliseconds, row.result.withoutMicromaps);
    fmt::print("\n");
}

void printCreation(const std::vector<cli::PipelineTiming> &results)
{
    fmt::print("| rays by | new pipeline and its first frame | layer off, ms | layer on, ms | on/off |\n"
               "|---|---|--:|--:|--:|\n");
    for (const cli::PipelineTiming &r : results)
        fmt::print("| {} | {} micromaps | {:.1f} | {:.1f} | {:.3f} |\n", nameOf(r.trace),
                   r.micromaps ? "with" : "without", r.bare, r.layered, r.ratio);
    fmt::print("\nAim for pipelines: at most 1.3.\n");
}

void printApis(const std::string &scene, render::Trace trace, const std::vector<bench::ApiResult> &results)
{
    for (const bench::ApiResult &r : results)
        fmt::print("| {} | {} | {} | {} | {} / {} | {:.3f} / {:.3f} | {:.1f} / {:.1f} | {:.3f} | {} |\n", scene,
                   nameOf(trace), r.level, r.heavy ? "heavy" : "plain", r.bytes[0], r.bytes[1], r.candidatesPerRay[0],
                   r.candidatesPerRay[1], r.milliseconds[0], r.milliseconds[1], r.ratio, r.differingPixels);
    std::fflush(stdout);
}

std::vector<std::optional<std::filesystem::path>> scenesOf(const Options &options)
{
    std::vector<std::optional<std::filesystem::path>> scenes(options.files.begin(), options.files.end());
    if (!scenes.empty())
        return scenes;
    for (const char *name : {"ash_medium.glb", "aspen_medium.glb", "bush_1.glb"}) {
        const std::filesystem::path path = std::filesystem::path(VELLUM_ASSETS) / name;
        if (std::filesystem::exists(path))
            scenes.emplace_back(path);
    }
    if (scenes.empty())
        scenes.emplace_back(std::nullopt); // the grove
    return scenes;
}

bool wants(const Options &options, const char *part)
{
    return std::find(options.parts.begin(), options.parts.end(), part) != options.parts.end();
}

std::vector<Row> measureFrames(const Options &options, const cli::TimedDevices &devices,
                               render::RenderSettings settings, const std::vector<render::Trace> &traces)
{
    std::vector<Row> rows;
    for (const auto &file : scenesOf(options)) {
        const std::string name = file ? file->stem().string() : "grove";
        for (const uint32_t copies : options.instances) {
            const render::RenderScene scene = render::prepareScene(cli::loadScene(file), copies);
            for (const render::Trace trace : traces) {
                ProgressLine progress(fmt::format("{} x {}, {}", name, copies, nameOf(trace)));
                settings.trace = trace;
                rows.push_back({name, trace, copies,
                                bench::measureScene(devices, scene, settings, options.levels, options.repetitions,
                                                    [&](size_t done, size_t all) { progress.update(done, all); })});
            }
        }
    }
    return rows;
}

void measureApis(const Options &options, const gpu::DeviceInfo &info, render::RenderSettings settings)
{
    gpu::Device khr(info, gpu::Api::Khr);
    gpu::Device ext(info, gpu::Api::Ext);
    const std::vector<render::Trace> traces = render::tracesOf(info);
    fmt::print("| scene | rays by | level | alpha test | micromap bytes khr / ext | candidates/ray khr / ext "
               "| ms khr / ext | time khr/ext | differing pixels |\n|---|---|--:|---|--:|--:|--:|--:|--:|\n");
    for (const auto &file : scenesOf(options)) {
        const std::string name = file ? file->stem().string() : "grove";
        const render::RenderScene scene = render::prepareScene(cli::loadScene(file), 1);
        for (const render::Trace trace : traces) {
            ProgressLine progress(fmt::format("{}, {}, both extensions", name, nameOf(trace)));
            settings.trace = trace;
            const auto results = bench::compareApis({khr, ext}, scene, settings, options.levels, options.repetitions,
                                                    [&](size_t done, size_t all) { progress.update(done, all); });
            printApis(name, trace, results);
        }
    }
    fmt::print("\nAim: 0.97 to 1.03, the same candidates, no differing pixel.\n\n");
}

void run(const Options &options)
{
    render::RenderSettings settings;
    cli::parseSize(options.size, settings);
    cli::disableShaderCaches();
    gpu::offerLayer(options.layerFolder);
    const gpu::Instance without(false);
    const gpu::Instance with(true);
    const gpu::DeviceInfo info = gpu::DeviceSelection(options.device).from(with);
    gpu::requireMicromaps(info, options.api, with.hasLayers());
    const bool both = info.khrMicromaps && info.extMicromaps;
    gpu::Device bare(gpu::DeviceSelection(options.device).from(without), std::nullopt);
    gpu::Device layered(info, options.api);
    const cli::TimedDevices devices{bare, layered};
    fmt::print("{}, micromaps: {}, {}. {} x {} pixels, median of {}.{}{}\n\n", info.name, gpu::extensionOf(options.api),
               info.implementation, settings.width, settings.height, options.repetitions,
               info.rayTracingPipelines ? "" : " There are no ray tracing pipelines.",
               both ? "" : " There is only one of the extensions.");
    std::fflush(stdout);

    std::vector<render::Trace> traces;
    if (wants(options, "queries") && info.rayQueries)
        traces.push_back(render::Trace::Query);
    if (wants(options, "pipelines") && info.rayTracingPipelines)
        traces.push_back(render::Trace::Pipeline);
    if (!traces.empty()) {
        const std::vector<Row> rows = measureFrames(options, devices, settings, traces);
        printLevels(rows);
        printScenes(rows);
        std::fflush(stdout);
    }
    if (wants(options, "apis") && both)
        measureApis(options, info, settings);
    if (wants(options, "creation")) {
        const render::RenderScene scene = render::prepareScene(cli::loadScene(scenesOf(options).front()), 1);
        const ProgressLine progress("making pipelines");
        std::vector<cli::PipelineTiming> results;
        for (const render::Trace trace : render::tracesOf(info))
            for (const cli::PipelineTiming &timing : cli::measurePipelines(
                     devices, scene, trace, options.levels.front(), [] {},
                     [&](size_t pairs) { return pairs < options.repetitions; }))
                results.push_back(timing);
        printCreation(results);
    }
}

} // namespace

int main(int argc, char **argv)
{
    try {
        Options options;
        CLI::App app("Compares frames with and without opacity micromaps; prints Markdown.", "vellum-bench");
        app.add_option("files", options.files, "GLB files; without: the shared trees, or the grove");
        app.add_option("-p,--parts", options.parts,
                       "What to measure: frames by queries, frames by pipelines, creation of pipelines, frames with\n"
                       "either extension; without: all")
            ->check(CLI::IsMember(options.parts).description(""))
            ->type_name("queries|pipelines|creation|apis ...");
        std::string api = "khr";
        app.add_option("-a,--api", api, "The extension for micromaps, except in the part apis")
            ->capture_default_str()
            ->check(CLI::IsMember(cli::micromapApis()).description(""))
            ->type_name("khr|ext");
        app.add_option("-s,--size", options.size, "Width and height in pixels")->capture_default_str();
        app.add_option("-r,--repetitions", options.repetitions, "Frames of each variant")
            ->capture_default_str()
            ->check(CLI::Range(1, 1000));
        app.add_option("-l,--levels", options.levels, "Subdivision levels")
            ->capture_default_str()
            ->check(CLI::Range(0, 12));
        app.add_option("-n,--instances", options.instances, "Numbers of copies")
            ->capture_default_str()
            ->check(CLI::Range(1, 1000));
        app.add_option("-d,--device", options.device, "The Vulkan device: a number or a part of its name");
        app.add_option("--layer-path", options.layerFolder, "Folder of the layer's manifest");
        CLI11_PARSE(app, argc, argv);
        options.api = cli::micromapApis().at(api);
        run(options);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-bench: %s\n", error.what());
        return 1;
    }
}
