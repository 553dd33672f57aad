// SPDX-License-Identifier: Apache-2.0

#include <map>
#include <memory>

#include "base/error.h"
#include "cli/bake/bake.h"
#include "cli/base/files.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/render_command.h"

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
    std::string size;
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
    command.add_option("-s,--size", raw.size, "Width and height in pixels [1280x720]")->type_name("WxH");
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
    if (!raw.size.empty())
        parseSize(raw.size, options.settings);
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
