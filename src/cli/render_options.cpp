#include "cli/render_options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "cli/commands.h"
#include "cli/render_command.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kRenderDetails = R"(
An ordinary Vulkan program: where the driver lacks VK_KHR_opacity_micromap or VK_EXT_opacity_micromap, the layer
VK_LAYER_VELLUM_opacity_micromap, which is turned on by default, brings it. Which device, which of the two and whose
implementation of it were used is printed.
It needs a Vulkan 1.3 device with ray queries, and with ray tracing pipelines for --trace pipeline; Mesa's lavapipe is
one that runs on any processor.

Examples:
  vellum render
      draws the built-in grove to vellum.png
  vellum render ash.glb --mode compare --output ash.png
      draws a tree with and without micromaps, and prints what they save
  vellum render ash.glb --mode compare --instances 9 --heavy --level 5
      nine copies, a costly alpha test, coarser and smaller micromaps
  vellum render ash.glb --mode compare --trace pipeline
      the same rays by a ray tracing pipeline with an any-hit shader
  vellum render ash.omm.glb --mode compare
      with the micromaps that the file has (vellum bake puts them there)
  vellum render ash.glb --mode heat --side-by-side
      how often the shader is asked at each pixel, without and with micromaps
  vellum render ash.glb --mode states --zoom 4
      the states of its micromaps in colours, from nearby
  vellum render ash.glb --yaw 120 --samples 4 --size 1920x1080
      a smooth picture from another side)";

uint32_t parseLevel(const std::string &text)
{
    try {
        size_t used = 0;
        const unsigned long level = std::stoul(text, &used);
        if (used == text.size() && level <= 12)
            return static_cast<uint32_t>(level);
    } catch (const std::exception &) {
        // Neither: said below.
    }
    throw Error("--level: " + text + " is neither a subdivision level (0 to 12) nor auto");
}

const std::map<std::string, Mode> kModes = {{"alpha", Mode::Alpha},
                                            {"omm", Mode::Micromaps},
                                            {"compare", Mode::Compare},
                                            {"states", Mode::States},
                                            {"heat", Mode::Heat}};
const std::map<std::string, Trace> kTraces = {{"query", Trace::Query}, {"pipeline", Trace::Pipeline}};

// What CLI11 stores as text. Names of enumerators too: it would take numbers and nothing for them.
struct RawOptions {
    std::string mode = "omm";
    std::string trace = "query";
    std::string api = "khr";
    std::string size;
    std::string level = "7";
    unsigned format = 4;
    bool noLayer = false;
    bool fewColors = false;
    std::vector<CLI::Option *> bakes; // those that ask for new micromaps
};

void declareRender(CLI::App &command, RenderOptions &options, RawOptions &raw)
{
    command.footer(kRenderDetails);
    command.add_option("file", options.input, "A .glb or .gltf file; the built-in grove without");
    command
        .add_option("-m,--mode", raw.mode,
                    "alpha: no micromaps, the shader samples the texture for every candidate.\n"
                    "omm: micromaps, it samples only where they are unknown.\n"
                    "compare: both, with a table of times, candidates per ray and differing pixels.\n"
                    "states: the micromaps' states in colours, which are printed.\n"
                    "heat: how many candidates the shader is handed at each pixel [omm]")
        ->check(CLI::IsMember(kModes).description(""))
        ->take_last() // scripts/demo puts its own before its user's
        ->type_name("alpha|omm|compare|states|heat");
    command
        .add_option("-t,--trace", raw.trace,
                    "query: ray queries in a compute shader.\n"
                    "pipeline: a ray tracing pipeline, whose any-hit shader samples the texture [query]")
        ->check(CLI::IsMember(kTraces).description(""))
        ->type_name("query|pipeline");
    command
        .add_option("-a,--api", raw.api,
                    "What micromaps are made with: khr, VK_KHR_opacity_micromap, or ext,\n"
                    "VK_EXT_opacity_micromap [khr]")
        ->check(CLI::IsMember(micromapApis()).description(""))
        ->type_name("khr|ext");
    command
        .add_option("-o,--output", options.output,
                    "The PNG to write; compare writes <name>-alpha.png too, and\n"
                    "<name>-difference.png if there is any [vellum.png]")
        ->take_last();
    command.add_option("-s,--size", raw.size, "Width and height in pixels [1280x720]")->type_name("WxH");
    command.add_option("--samples", options.settings.samples, "Rays per pixel, averaged: 1 to 256 [1]")
        ->check(CLI::Range(1, 256).description(""));
    command.add_flag("--bake", options.bakeAnew, "Bake the micromaps, even if the file has some");
    raw.bakes.push_back(command.add_option("-l,--level", raw.level,
                                           "Subdivision level of the micromaps, 0 to 12, or auto: by the texture's\n"
                                           "density; bakes them [7]"));
    raw.bakes.push_back(command.add_option("-f,--format", raw.format,
                                           "4: four states, exact. 2: two states, an approximation;\n"
                                           "bakes them [4]"));
    raw.bakes.back()->check(CLI::IsMember({2, 4}).description(""))->type_name("2|4");
    command.add_option("-n,--instances", options.instances, "Copies of the scene on a square grid: 1 to 1000 [1]")
        ->check(CLI::Range(1, 1000).description(""));
    command
        .add_option("--frames", options.frames,
                    "Frames to time, whose median is printed; for compare, pairs of frames [5; for\n"
                    "compare 9 to 99, as many as it takes, within a minute if it can]")
        ->check(CLI::Range(1, 10000).description(""));
    command.add_flag("--side-by-side", options.sideBySide,
                     "With --mode states: the picture by micromaps to the left of the states.\n"
                     "With --mode heat: the map without micromaps to the left of the one with\n"
                     "them, in the same colours");
    command.add_flag("--heavy", options.settings.heavy, "16 more texture reads per candidate, like a costly material");
    command.add_option("--yaw", options.settings.view.yaw, "Turn of the camera around the scene in degrees [25]");
    command.add_option("--pitch", options.settings.view.pitch, "Tilt of the camera in degrees, -85 to 85 [3]")
        ->check(CLI::Range(-85, 85).description(""));
    command.add_option("--zoom", options.settings.view.zoom, "Above 1 closer than to see everything [1]")
        ->check(CLI::Range(0.05, 20.0).description(""));
    command.add_flag("--few-colors", raw.fewColors, "PNGs of at most 256 colours: about half of the bytes");
    command.add_option("-d,--device", options.device, "The Vulkan device: a number or a part of its name");
    command.add_flag("--no-layer", raw.noLayer, "Do not turn the layer on");
    command
        .add_option("--layer-path", options.layerFolder,
                    "Folder of the layer's manifest, instead of the one beside this program")
        ->type_name("FOLDER");
}

void finishRender(RenderOptions &options, const RawOptions &raw)
{
    if (!raw.size.empty())
        parseSize(raw.size, options.settings);
    if (raw.level != "auto")
        options.bake.level = parseLevel(raw.level);
    options.mode = kModes.at(raw.mode);
    options.settings.trace = kTraces.at(raw.trace);
    options.api = micromapApis().at(raw.api);
    options.layer = !raw.noLayer;
    options.colors = raw.fewColors ? Colors::Few : Colors::All;
    for (const CLI::Option *option : raw.bakes)
        options.bakeAnew |= option->count() > 0;
    if (options.sideBySide && options.mode != Mode::States && options.mode != Mode::Heat)
        throw Error("--side-by-side is for --mode states and --mode heat");
    if (options.mode == Mode::States && options.settings.trace != Trace::Query)
        throw Error("--mode states draws by ray queries, without --trace pipeline");
    if ((options.mode == Mode::States || options.mode == Mode::Heat) && options.frames)
        throw Error("--mode " + raw.mode + " times nothing, so it takes no --frames");
    // NaN passes CLI11's range checks.
    const View &view = options.settings.view;
    if (!std::isfinite(view.yaw) || !std::isfinite(view.pitch) || !std::isfinite(view.zoom))
        throw Error("the camera's --yaw, --pitch and --zoom must be numbers");
    options.bake.format = raw.format == 2 ? Format::TwoState : Format::FourState;
}

} // namespace

const std::map<std::string, MicromapApi> &micromapApis()
{
    static const std::map<std::string, MicromapApi> apis = {{"khr", MicromapApi::Khr}, {"ext", MicromapApi::Ext}};
    return apis;
}

void parseSize(const std::string &text, RenderSettings &settings)
{
    unsigned width = 0;
    unsigned height = 0;
    char rest = 0;
    const bool read =
        text.find('-') == std::string::npos && std::sscanf(text.c_str(), "%5ux%5u%c", &width, &height, &rest) == 2;
    if (!read || width == 0 || height == 0 || width > 16384 || height > 16384)
        throw Error("--size: " + text + " is not a size like 1280x720, of 1 to 16384 pixels each way");
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
    declareRender(
        *app.add_subcommand("render", "Renders foliage, from a glTF file or built in, to a PNG by tracing rays"),
        all->options, all->raw);
    return [all] {
        finishRender(all->options, all->raw);
        return renderCommand(all->options);
    };
}

} // namespace vellum::cli
