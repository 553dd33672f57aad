// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <numeric>

#include "base/error.h"
#include "base/picture.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/render_command.h"
#include "core/utf8_path.h"
#include "gpu/instance.h"
#include "inspect/report_parts.h"
#include "render/baked_scene.h"
#include "render/grove.h"
#include "render/heat.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kRenderDetails = R"(
An ordinary Vulkan program. If the driver lacks VK_KHR_opacity_micromap or VK_EXT_opacity_micromap, the layer
VK_LAYER_VELLUM_opacity_micromap, which is enabled by default, provides it. The report names the device, the extension and
whose implementation of it was used. The device needs Vulkan 1.3 with ray queries, and ray tracing pipelines for --trace
pipeline; Mesa's lavapipe is one that runs on any processor.

A file without micromaps is baked for the picture, which the report states; with --json, it is the member baked. Materials
of alphaMode BLEND are not blended: alpha is tested with the cutoff 0.5, or the one that they were baked with.

Without OUT, NAME.png (with --mode heat NAME.svg) is written beside the input, and vellum.png in the current folder for the
built-in scene. An existing file is replaced only if vellum wrote it, or with --force.

Modes:
  alpha    no micromaps: the shader samples the texture for every candidate
  omm      micromaps: it samples the texture only where they are unknown
  compare  both, with a table of times, candidates per ray and differing pixels
  states   the states of the micromaps in colours, which are printed
  heat     how many candidates the shader is handed at each pixel, with a legend: an SVG

Examples:
  vellum render
      draws the built-in grove to vellum.png
  vellum render ash.glb ash.png --mode compare
      draws a tree with and without micromaps, and prints what they save
  vellum render ash.glb --mode compare --instances 9 --heavy --level 5
      nine copies, a costly alpha test, coarser and smaller micromaps
  vellum render ash.glb --mode compare --trace pipeline
      the same rays by a ray tracing pipeline with an any-hit shader
  vellum render ash.omm.glb --mode compare --json
      with the micromaps that vellum bake put into the file, for a script
  vellum render ash.glb --mode heat --side-by-side
      how often the shader is invoked at each pixel, without and with micromaps
  vellum render ash.glb --mode states --zoom 4
      the states of its micromaps in colours, from nearby
  vellum render ash.glb --yaw 120 --samples 4 --size 1920x1080
      a smooth picture from another side
  vellum render ash.glb - | display
      the picture goes to stdout, the report to stderr

Environment:
  VK_DRIVER_FILES, VK_ADD_DRIVER_FILES, VK_LAYER_PATH, VK_ADD_LAYER_PATH
      the Vulkan loader's: which drivers and layers it uses
)";

std::filesystem::path withSuffix(const std::filesystem::path &path, const char *suffix)
{
    std::filesystem::path result = path;
    (result.replace_extension() += suffix) += path.extension();
    return result;
}

// The pictures of --mode compare, in the order in which they are written; of other modes only the first is.
std::vector<std::filesystem::path> picturesOf(const RenderOptions &options, bool difference)
{
    std::vector<std::filesystem::path> paths = {options.output};
    if (options.mode == Mode::Compare)
        paths.push_back(withSuffix(options.output, "-alpha"));
    if (options.mode == Mode::Compare && difference)
        paths.push_back(withSuffix(options.output, "-difference"));
    return paths;
}

// Returns whether the pictures are drawn with micromaps that a device holds.
bool tracesMicromaps(const RenderOptions &options)
{
    return options.mode == Mode::Micromaps || options.mode == Mode::Compare || options.mode == Mode::Heat ||
           options.sideBySide;
}

std::string describeInstances(const RenderOptions &options, const render::RenderScene &scene)
{
    std::string text;
    if (scene.scene.instances.size() > scene.scene.meshes.size())
        text = fmt::format(", {} of {}", counted(scene.scene.instances.size(), "instance"),
                           counted(scene.scene.meshes.size(), "mesh", "meshes"));
    if (options.instances > 1)
        text += fmt::format(", {} copies", options.instances);
    return text;
}

void printScene(const RenderOptions &options, const gpu::DeviceInfo &device, const render::RenderScene &scene)
{
    fmt::print("device      {}\n", device.name);
    fmt::print("rays        by {}\n",
               options.settings.trace == render::Trace::Query ? "ray queries" : "a ray tracing pipeline");
    fmt::print("micromaps   {}\n", options.mode == Mode::Alpha ? "not used"
                                   : !tracesMicromaps(options)
                                       ? "drawn, not used by the rays"
                                       : fmt::format("{}, {}", gpu::extensionOf(options.api), device.implementation));
    fmt::print("scene       {}: {} masked and {} solid triangles{}\n",
               options.input ? utf8Text(options.input->filename()) : "the built-in grove",
               grouped(scene.maskedTriangles()), grouped(scene.solidTriangles()), describeInstances(options, scene));
    std::fflush(stdout);
}

void printMicromaps(const RenderOptions &options, const Scene &scene, const render::BakedScene &baked)
{
    const auto shares = baked.stateShares();
    const std::string states = fmt::format("{} transparent, {} opaque, {} unknown, of triangles, each counted alike",
                                           percent(shares[0]), percent(shares[1]), percent(shares[2] + shares[3]));
    if (baked.extension.empty())
        fmt::print("baked       {}level {}, {}: {}\n",
                   options.input && !options.bakeAnew ? "for this picture, as the file has no micromaps: " : "",
                   options.bake.level ? std::to_string(*options.bake.level) : "auto",
                   counted(baked.distinctTriangles, "distinct triangle"), states);
    else
        fmt::print("in the file {} by {}, {}: {}\n", counted(baked.count(), "geometry", "geometries"), baked.extension,
                   counted(baked.distinctTriangles, "micromap triangle"), states);
    const std::vector<const Micromap *> micromaps = baked.micromaps();
    if (const auto surface = surfaceShares(scene, [&](size_t geometry) { return micromaps[geometry]; }))
        fmt::print("surface     {}\n", describe(*surface));
    std::fflush(stdout);
}

// Masked geometries without a micromap: the shader samples their texture.
void printTestedOnly(const RenderOptions &options, const render::RenderScene &scene, const render::BakedScene &baked)
{
    size_t masked = 0;
    size_t blended = 0;
    for (size_t i = 0; i < baked.results.size(); ++i) {
        const Material &material = scene.scene.materials[scene.scene.geometries[i].material];
        if (material.masked() && !baked.results[i])
            ++(material.alphaMode == AlphaMode::Blend && !(baked.extension.empty() && options.blend) ? blended
                                                                                                     : masked);
    }
    if (masked != 0)
        fmt::print("alpha test  alone for {} without micromaps{}\n",
                   counted(masked, "masked geometry", "masked geometries"),
                   baked.extension.empty() ? ", whose vertices have alphas" : "; --bake makes some");
    if (blended != 0)
        fmt::print("alpha test  alone for {} with alphaMode BLEND; --blend bakes {}\n",
                   counted(blended, "geometry", "geometries"), blended == 1 ? "it" : "them");
}

// What is drawn of alphaMode BLEND.
void printBlend(const Scene &scene)
{
    std::map<float, size_t> geometries; // by cutoff
    for (const Geometry &geometry : scene.geometries)
        if (const Material &material = scene.materials[geometry.material]; material.alphaMode == AlphaMode::Blend)
            ++geometries[material.alphaCutoff];
    for (const auto &[cutoff, count] : geometries)
        fmt::print("blending    none: {} with alphaMode BLEND {} masked with the cutoff {:.9g}\n",
                   counted(count, "geometry", "geometries"), count == 1 ? "is" : "are", cutoff);
}

render::BakedScene bakeWithProgress(const RenderOptions &options, const Scene &scene)
{
    ProgressLine progress("baking");
    BakeOptions bake = options.bake;
    bake.progress = [&](size_t done, size_t total) { progress.update(done, total); };
    const render::BlendRule blend = !options.blend        ? render::BlendRule::Skip
                                    : options.blendCutoff ? render::BlendRule::Mask
                                                          : render::BlendRule::Exact;
    return render::bakeScene(scene, bake, blend);
}

void writePicture(const std::filesystem::path &path, const Picture &picture, std::optional<DataOutput> &data)
{
    writeData(path, encodePng(picture), data);
    if (!isStandardStream(path))
        fmt::print("wrote       {}\n", utf8Text(path));
    std::fflush(stdout); // timing may follow
}

// Adds the labels if the file is an SVG.
void writeLabelled(const std::filesystem::path &path, const LabelledPicture &labelled, std::optional<DataOutput> &data)
{
    if (suffixOf(path) == ".png" || isStandardStream(path))
        return writePicture(path, labelled.picture, data);
    writeData(path, encodeSvg(labelled), data);
    fmt::print("wrote       {}\n", utf8Text(path));
    std::fflush(stdout);
}

std::optional<gpu::Api> apiOf(const RenderOptions &options, bool micromaps)
{
    return micromaps ? std::optional(options.api) : std::nullopt;
}

int renderOne(const RenderOptions &options, gpu::Device &device, const render::RenderScene &scene,
              const std::vector<const Micromap *> &micromaps, std::optional<DataOutput> &data)
{
    std::unique_ptr<render::Renderer> renderer;
    std::vector<double> times;
    const uint32_t frames = options.frames.value_or(5);
    {
        ProgressLine progress("rendering");
        renderer = std::make_unique<render::Renderer>(device, scene, micromaps, options.settings);
        for (uint32_t i = 0; i < frames; ++i) {
            times.push_back(renderer->frame());
            progress.update(i + 1, frames);
        }
    }
    fmt::print("frame       {:.2f} ms, the median of {}\n", median(times), frames);
    const render::CandidateCount count = renderer->count();
    fmt::print("candidates  {:.3f} per ray handed to the shader\n", count.perRay());
    if (!micromaps.empty())
        fmt::print("memory      {} bytes of the device for micromaps\n", grouped(renderer->micromapBytes()));
    writePicture(options.output, renderer->picture(), data);
    return 0;
}

// Two renderers of one picture: without micromaps and with them.
struct Contest {
    gpu::Device plain, enabled; // the plain one enables no extension for micromaps and pays nothing for it
    render::Renderer alpha, omm;
    Contest(const RenderOptions &options, const gpu::DeviceInfo &info, const render::RenderScene &scene,
            const render::BakedScene &baked)
        : plain(info, apiOf(options, false)), enabled(info, apiOf(options, true)),
          alpha(plain, scene, {}, options.settings), omm(enabled, scene, baked.micromaps(), options.settings)
    {
    }
};

// Pairs of frames, as many as the options say. Otherwise until the ratio is known well enough for another run to come
// to the same within 2 %, in all likelihood: a third of that for the error of each. At most for a minute.
PairedTiming timeFrames(const RenderOptions &options, Contest &contest)
{
    constexpr size_t kFewest = 9;
    constexpr double kMost = 99;
    constexpr double kUncertainty = 0.007;
    constexpr double kMilliseconds = 60'000;
    ProgressLine progress("timing");
    double spent = 0;
    const auto timed = [&](render::Renderer &renderer) {
        return [&] {
            const double time = renderer.frame();
            spent += time;
            return time;
        };
    };
    PairedTiming timing(timed(contest.alpha), timed(contest.omm));
    double done = 0;
    while (done < 1) {
        timing.measure();
        const auto pairs = static_cast<double>(timing.pairs());
        if (options.frames)
            done = pairs / *options.frames;
        else if (timing.pairs() < kFewest)
            done = std::min(spent / kMilliseconds, 0.9);
        else
            done = std::max({pairs / kMost, spent / kMilliseconds, std::pow(kUncertainty / timing.uncertainty(), 2)});
        progress.update(static_cast<size_t>(1000 * std::min(done, 1.0)), 1000);
    }
    return timing;
}

void printComparison(const RenderOptions &options, Contest &contest, const PairedTiming &timing, uint64_t differing)
{
    const double counts[2] = {contest.alpha.count().perRay(), contest.omm.count().perRay()};
    const Quartiles ratio = timing.ratio(); // of pairs: not that of the medians, which may contradict it
    const std::string candidates = counts[0] > 0 ? fmt::format("{:.3f}", counts[1] / counts[0]) : "-";
    const double pixels = static_cast<double>(options.settings.width) * options.settings.height;
    fmt::print("\n|                                |        alpha |          omm | omm/alpha |\n"
               "|--------------------------------|-------------:|-------------:|----------:|\n");
    fmt::print("| frame, ms (median)             | {:>12.2f} | {:>12.2f} | {:>9} |\n", timing.a(), timing.b(), "");
    fmt::print("| candidates to the shader / ray | {:>12.3f} | {:>12.3f} | {:>9} |\n", counts[0], counts[1],
               candidates);
    fmt::print("| device memory of micromaps, B  | {:>12} | {:>12} | {:>9} |\n", 0,
               grouped(contest.omm.micromapBytes()), "");
    fmt::print("| differing pixels               | {:>12} | {:>12} | {:>9} |\n\n", "", grouped(differing),
               fmt::format("{:.4f} %", 100 * static_cast<double>(differing) / pixels));
    fmt::print("time ratio  {:.3f} (omm/alpha), the median of {} pairs of frames; half of the pairs lie between {:.3f} "
               "and {:.3f}\n",
               ratio.middle, timing.pairs(), ratio.low, ratio.high);
}

void writeComparison(const RenderOptions &options, const gpu::DeviceInfo &device, Contest &contest,
                     const PairedTiming &timing, const Difference &difference, bool made, DataOutput &data)
{
    const Quartiles ratio = timing.ratio();
    JsonWriter json;
    beginReport(json, "render");
    json.member("file", options.input ? utf8Text(*options.input) : "").member("device", device.name);
    json.member("extension", gpu::extensionOf(options.api)).member("implementation", device.implementation);
    json.member("trace", options.settings.trace == render::Trace::Query ? "query" : "pipeline");
    json.member("width", options.settings.width).member("height", options.settings.height);
    json.key("outputs").beginArray();
    for (const auto &path : picturesOf(options, difference.pixels != 0))
        json.value(utf8Text(path));
    json.end().key("frameMs").beginObject().member("alpha", timing.a()).member("omm", timing.b()).end();
    json.key("timeRatio").beginObject().member("median", ratio.middle).member("low", ratio.low);
    json.member("high", ratio.high).member("pairs", timing.pairs()).end();
    json.key("candidatesPerRay").beginObject().member("alpha", contest.alpha.count().perRay());
    json.member("omm", contest.omm.count().perRay()).end();
    json.member("baked", made)
        .member("bytes", contest.omm.micromapBytes())
        .member("differingPixels", difference.pixels);
    data.write(json.end().text() + "\n");
    data.finish();
}

int renderBoth(const RenderOptions &options, const gpu::DeviceInfo &info, const render::RenderScene &scene,
               const render::BakedScene &baked, std::optional<DataOutput> &data)
{
    std::unique_ptr<Contest> contest;
    Picture pictures[2];
    {
        const ProgressLine progress("rendering");
        contest = std::make_unique<Contest>(options, info, scene, baked);
        // These frames also warm up.
        contest->alpha.frame();
        contest->omm.frame();
        pictures[0] = contest->alpha.picture();
        pictures[1] = contest->omm.picture();
    }
    const Difference difference = compare(pictures[0], pictures[1]);
    const std::vector<std::filesystem::path> paths = picturesOf(options, difference.pixels != 0);
    writePicture(paths[0], pictures[1], data);
    writePicture(paths[1], pictures[0], data);
    if (difference.pixels != 0)
        writePicture(paths[2], difference.amplified, data);
    const PairedTiming timing = timeFrames(options, *contest);
    if (options.json)
        writeComparison(options, info, *contest, timing, difference, baked.extension.empty(), *data);
    else
        printComparison(options, *contest, timing, difference.pixels);
    return 0;
}

int renderStates(const RenderOptions &options, const gpu::DeviceInfo &info, const render::RenderScene &scene,
                 const render::BakedScene &baked, std::optional<DataOutput> &data)
{
    const auto draw = [&](bool states) {
        render::RenderSettings settings = options.settings;
        settings.paintStates = states;
        gpu::Device device(info, apiOf(options, !states));
        render::Renderer renderer(device, scene, baked.micromaps(), settings);
        renderer.frame();
        return renderer.picture();
    };
    Picture picture;
    {
        const ProgressLine progress("rendering");
        picture = draw(true);
        if (options.sideBySide)
            picture = sideBySide(draw(false), picture);
    }
    const auto color = [](State state) { return kStateColors[static_cast<size_t>(state)]; };
    fmt::print(
        "states      opaque #{:06x}, transparent #{:06x} (a veil), unknown: opaque #{:06x}, transparent #{:06x}\n",
        color(State::Opaque), color(State::Transparent), color(State::UnknownOpaque), color(State::UnknownTransparent));
    writePicture(options.output, picture, data);
    return 0;
}

int renderHeat(const RenderOptions &options, const gpu::DeviceInfo &info, const render::RenderScene &scene,
               const render::BakedScene &baked, std::optional<DataOutput> &data)
{
    std::vector<render::HeatMap> maps;
    {
        const ProgressLine progress("rendering");
        const auto measure = [&](bool micromaps) {
            gpu::Device device(info, apiOf(options, micromaps));
            render::Renderer renderer(device, scene, micromaps ? baked.micromaps() : std::vector<const Micromap *>(),
                                      options.settings);
            maps.push_back({options.settings.width, options.settings.height, renderer.candidatesPerPixel(),
                            micromaps ? "with micromaps" : "without micromaps"});
        };
        if (options.sideBySide)
            measure(false);
        measure(true);
    }
    for (render::HeatMap &map : maps) {
        const double mean =
            std::accumulate(map.values.begin(), map.values.end(), 0.0) / static_cast<double>(map.values.size());
        fmt::print("candidates  {:.3f} per pixel on average, at most {:.0f}, {}\n", mean,
                   *std::max_element(map.values.begin(), map.values.end()), map.title);
        map.title += fmt::format(": {:.2f}", mean);
    }
    writeLabelled(options.output, render::drawHeat(maps, render::heatScale(maps), "candidates per pixel"), data);
    return 0;
}

// A scene, with the file's micromaps if they are used.
struct Loaded {
    Scene scene;
    StoredMicromaps stored;
};

Loaded load(const RenderOptions &options)
{
    if (!options.input)
        return {render::makeGrove(), {}};
    const Document document = openDocument(*options.input);
    const bool wanted = options.mode != Mode::Alpha && !options.bakeAnew;
    Loaded loaded = withinMemory(*options.input, [&] {
        return Loaded{readScene(document), wanted ? readMicromaps(document) : StoredMicromaps{}};
    });
    if (const auto cutoff = options.blendCutoff ? options.blendCutoff : blendCutoffOf(document.root()))
        for (Material &material : loaded.scene.materials)
            if (material.alphaMode == AlphaMode::Blend)
                material.alphaCutoff = *cutoff;
    return loaded;
}

render::Trace traceOf(const RenderOptions &options, const gpu::DeviceInfo &device)
{
    if (!device.rayTracingPipelines && options.trace == render::Trace::Pipeline)
        throw Error(device.name +
                    " has no ray tracing pipelines (VK_KHR_ray_tracing_pipeline); --trace query does without");
    if (!device.rayQueries && options.mode == Mode::States)
        throw Error(device.name + " has no ray queries (VK_KHR_ray_query), by which --mode states draws");
    if (!device.rayQueries && options.trace == render::Trace::Query)
        throw Error(device.name + " has no ray queries (VK_KHR_ray_query); --trace pipeline does without");
    return options.trace.value_or(render::tracesOf(device).front());
}

const std::map<std::string, Mode> kModes = {{"alpha", Mode::Alpha},
                                            {"omm", Mode::Micromaps},
                                            {"compare", Mode::Compare},
                                            {"states", Mode::States},
                                            {"heat", Mode::Heat}};
const std::map<std::string, render::Trace> kTraces = {{"query", render::Trace::Query},
                                                      {"pipeline", render::Trace::Pipeline}};

// The text that CLI11 stores.
struct RawOptions {
    std::optional<std::filesystem::path> operand; // OUT
    std::optional<std::filesystem::path> output;  // -o
    std::string mode = "omm";
    std::string trace;
    std::string api = "khr";
    std::string level = "auto";
    std::string states = "4";
    bool noLayer = false;
    std::vector<CLI::Option *> bakes; // options that request new micromaps
};

void declareFiles(CLI::App &command, RenderOptions &options, RawOptions &raw)
{
    command.option_defaults()->group(kInput);
    command.add_option("IN", options.input, "A .glb or .gltf file; the built-in grove without")->type_name("[IN]");
    command.add_option("OUT", raw.operand, "The same as -o OUT")->type_name("[OUT]");
    command.option_defaults()->group(kOutput);
    command
        .add_option(
            "-o,--output", raw.output,
            "The PNG to write, a folder, or - for stdout; compare also writes NAME-alpha.png, and NAME-difference.png "
            "if there is any; heat writes an SVG, whose legend a PNG lacks [NAME.png beside the input, or vellum.png]")
        ->take_last()
        ->type_name("OUT");
    command.add_flag("--force", options.force, "Replace existing files, whoever wrote them");
    command.add_flag("--json", options.json, "With --mode compare: print JSON");
    command.add_flag("-q,--quiet", options.quiet, "Print errors only")->group(kGeneral);
}

void declarePicture(CLI::App &command, RenderOptions &options, RawOptions &raw)
{
    command.option_defaults()->group(kPicture);
    takesWords(*command.add_option("-m,--mode", raw.mode, "What to draw: see below [omm]"),
               {"alpha", "omm", "compare", "states", "heat"});
    command.get_option("--mode")->take_last(); // scripts/demo puts its own before its user's
    takesWords(
        *command.add_option("-t,--trace", raw.trace,
                            "Ray queries in a compute shader, or a ray tracing pipeline [query, if the device has "
                            "ray queries]"),
        {"query", "pipeline"});
    command
        .add_option_function<std::string>(
            "-s,--size", [&options](const std::string &text) { parseSize(text, options.settings); },
            "Width and height in pixels [1280x720]")
        ->type_name("WxH");
    command.add_option("--samples", options.settings.samples, "Rays per pixel, averaged: 1 to 256 [1]")
        ->check(wholeBetween(1, 256))
        ->type_name("COUNT");
    command.add_option("-n,--instances", options.instances, "Copies of the scene on a square grid: 1 to 1000 [1]")
        ->check(wholeBetween(1, 1000))
        ->type_name("COUNT");
    command
        .add_option("--frames", options.frames,
                    "Frames to time, whose median is printed; for compare, pairs of frames [5; for compare 9 to 99, as "
                    "many as the result needs, within a minute if possible]")
        ->check(wholeBetween(1, 10000))
        ->type_name("COUNT");
    command.add_flag(
        "--side-by-side", options.sideBySide,
        "With --mode states: the picture by micromaps to the left of the states. With --mode heat: the map "
        "without micromaps to the left of the one with them, in the same colours");
    command.add_flag("--heavy", options.settings.heavy, "16 more texture reads per candidate, like a costly material");
    command.add_option("--yaw", options.settings.view.yaw, "Turn of the camera around the scene in degrees [25]")
        ->check(finite())
        ->type_name("DEGREES");
    command.add_option("--pitch", options.settings.view.pitch, "Tilt of the camera in degrees, -85 to 85 [3]")
        ->check(between(-85, 85))
        ->type_name("DEGREES");
    command.add_option("--zoom", options.settings.view.zoom, "Above 1 closer than to see everything, 0.05 to 20 [1]")
        ->check(between(0.05, 20))
        ->type_name("FACTOR");
}

void declareQuality(CLI::App &command, RenderOptions &options, RawOptions &raw)
{
    command.option_defaults()->group(kQuality);
    command.add_flag("--bake", options.bakeAnew, "Bake the micromaps, even if the file has some");
    raw.bakes.push_back(command
                            .add_option("-l,--level", raw.level,
                                        "Subdivision level of the micromaps, 0 to 12, or auto: by the texels that a "
                                        "triangle covers; bakes them [auto]")
                            ->type_name("LEVEL"));
    raw.bakes.push_back(command.add_option("--states", raw.states,
                                           "4: four states, exact. 2: two states, an approximation; bakes them [4]"));
    takesWords(*raw.bakes.back(), {"2", "4"});
    raw.bakes.push_back(&addBlendOptions(command, options.blend, options.blendCutoff,
                                         "Bake alphaMode BLEND as well, as vellum bake does; the picture tests it "
                                         "like a mask in any case; bakes them",
                                         "With --blend: bake and test it with this cutoff [0.5 to test]"));
}

void declareDevice(CLI::App &command, RenderOptions &options, RawOptions &raw)
{
    command.option_defaults()->group(kDevice);
    takesWords(*command.add_option("-a,--api", raw.api,
                                   "The extension to use: VK_KHR_opacity_micromap or VK_EXT_opacity_micromap [khr]"),
               {"khr", "ext"});
    addDeviceOption(command, options.device);
    command.add_flag("--no-layer", raw.noLayer, "Do not enable the layer");
    addLayerPathOption(command, options.layerFolder);
}

// In the folder of the input, or in the current folder.
std::filesystem::path standardOutput(const RenderOptions &options)
{
    const char *suffix = options.mode == Mode::Heat ? ".svg" : ".png";
    if (!options.input || isStandardStream(*options.input))
        return std::string("vellum") + suffix;
    std::filesystem::path output = *options.input;
    return output.replace_extension(suffix);
}

void checkTogether(const RenderOptions &options, const RawOptions &raw)
{
    if (raw.operand && raw.output)
        throw UsageError("OUT and --output exclude each other");
    checkSuffix(options.output, options.mode == Mode::Heat ? std::initializer_list<std::string>{".svg", ".png"}
                                                           : std::initializer_list<std::string>{".png"});
    if (isStandardStream(options.output) && options.mode == Mode::Compare)
        throw UsageError("--mode compare writes several pictures, so not to stdout");
    if (options.json && options.mode != Mode::Compare)
        throw UsageError("--json is for --mode compare");
    if (options.sideBySide && options.mode != Mode::States && options.mode != Mode::Heat)
        throw UsageError("--side-by-side is for --mode states and --mode heat");
    if (options.mode == Mode::States && options.trace == render::Trace::Pipeline)
        throw UsageError("--mode states draws by ray queries, without --trace pipeline");
    if ((options.mode == Mode::States || options.mode == Mode::Heat) && options.frames)
        throw UsageError("--mode " + raw.mode + " times nothing, so it takes no --frames");
}

void finishRender(RenderOptions &options, const RawOptions &raw)
{
    options.bake.level = parseLevel(raw.level);
    options.bake.format = raw.states == "2" ? Format::TwoState : Format::FourState;
    options.mode = kModes.at(raw.mode);
    if (!raw.trace.empty())
        options.trace = kTraces.at(raw.trace);
    options.api = micromapApis().at(raw.api);
    options.layer = !raw.noLayer;
    for (const CLI::Option *option : raw.bakes)
        options.bakeAnew |= option->count() > 0;
    options.output = outputFor(raw.operand ? raw.operand : raw.output, standardOutput(options));
    checkTogether(options, raw);
}

} // namespace

Scene loadScene(const std::optional<std::filesystem::path> &file)
{
    return file ? readGltf(*file) : render::makeGrove();
}

int renderCommand(RenderOptions options)
{
    for (const std::filesystem::path &path : picturesOf(options, true))
        checkWritable(path, options.force);
    std::optional<DataOutput> data; // stdout, for the picture or JSON
    if (options.json)
        data.emplace(DataOutput::Reports::Discarded);
    else if (isStandardStream(options.output))
        data.emplace(DataOutput::Reports::ToStderr);
    if (options.quiet && !options.json)
        discardReports();
    render::RenderScene scene;
    StoredMicromaps stored;
    {
        const ProgressLine progress("reading");
        Loaded loaded = load(options);
        stored = std::move(loaded.stored);
        scene = render::prepareScene(std::move(loaded.scene), options.instances);
    }
    if (options.layer)
        gpu::offerLayer(options.layerFolder);
    const gpu::Instance instance(options.layer);
    const gpu::DeviceInfo info = options.device.from(instance);
    if (tracesMicromaps(options))
        gpu::requireMicromaps(info, options.api, instance.hasLayers());
    options.settings.trace = traceOf(options, info);
    printScene(options, info, scene);
    printBlend(scene.scene);
    if (options.mode == Mode::Alpha) {
        gpu::Device device(info, apiOf(options, false));
        return renderOne(options, device, scene, {}, data);
    }
    const render::BakedScene baked =
        stored.extension.empty() ? bakeWithProgress(options, scene.scene) : render::storedScene(scene.scene, stored);
    printMicromaps(options, scene.scene, baked);
    printTestedOnly(options, scene, baked);
    if (options.mode == Mode::Compare)
        return renderBoth(options, info, scene, baked, data);
    if (options.mode == Mode::States)
        return renderStates(options, info, scene, baked, data);
    if (options.mode == Mode::Heat)
        return renderHeat(options, info, scene, baked, data);
    gpu::Device device(info, apiOf(options, true));
    return renderOne(options, device, scene, baked.micromaps(), data);
}

const std::map<std::string, gpu::Api> &micromapApis()
{
    static const std::map<std::string, gpu::Api> apis = {{"khr", gpu::Api::Khr}, {"ext", gpu::Api::Ext}};
    return apis;
}

void parseSize(const std::string &text, render::RenderSettings &settings)
{
    unsigned width = 0;
    unsigned height = 0;
    char rest = 0;
    const bool read =
        text.find('-') == std::string::npos && std::sscanf(text.c_str(), "%5ux%5u%c", &width, &height, &rest) == 2;
    if (!read || width == 0 || height == 0 || width > 16384 || height > 16384)
        throw UsageError("--size must be a size like 1280x720, of 1 to 16384 pixels each way, got " + text);
    settings.width = width;
    settings.height = height;
}

std::function<int()> declareRenderCommand(CLI::App &app)
{
    struct Options {
        RenderOptions options;
        RawOptions raw;
    };
    const auto all = std::make_shared<Options>();
    CLI::App &command =
        *app.add_subcommand("render", "Renders a glTF file, or built-in foliage, to a PNG by tracing rays");
    command.footer(kRenderDetails);
    declareFiles(command, all->options, all->raw);
    declarePicture(command, all->options, all->raw);
    declareQuality(command, all->options, all->raw);
    declareDevice(command, all->options, all->raw);
    return [all] {
        finishRender(all->options, all->raw);
        return renderCommand(all->options);
    };
}

} // namespace vellum::cli
