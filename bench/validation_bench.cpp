// SPDX-License-Identifier: Apache-2.0
// vellum-validation-bench: what the setting `validate` costs, against the layer without it: devices, the builds of a
// scene, and frames. vellum-command-bench --validate measures the recording of commands.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "base/statistics.h"
#include "cli/bench/timing.h"
#include "cli/render_command.h"
#include "gpu/instance.h"
#include "render/baked_scene.h"

namespace
{

using namespace vellum;

constexpr gpu::Api kApi = gpu::Api::Khr;

double milliseconds(const std::function<void()> &work)
{
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

// A device with validation off or on.
struct Side {
    Side(const char *validate, const std::optional<std::string> &wanted)
    {
        setenv("VELLUM_VALIDATE", validate, 1); // read when the instance is made
        instance = std::make_unique<gpu::Instance>(true);
        info = gpu::DeviceSelection(wanted).from(*instance);
        device = std::make_unique<gpu::Device>(info, kApi);
    }
    std::unique_ptr<gpu::Instance> instance;
    gpu::DeviceInfo info;
    std::unique_ptr<gpu::Device> device;
};

void compare(const Side &off, const Side &on, const char *parts, unsigned repetitions)
{
    const auto row = [&](const std::string &what, const std::function<double(const Side &)> &measure) {
        measure(off);
        measure(on);
        PairedTiming times([&] { return measure(off); }, [&] { return measure(on); });
        for (unsigned r = 0; r < repetitions; ++r)
            times.measure();
        fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.3f} |\n", what, parts, times.a(), times.b(), times.ratio().middle);
        std::fflush(stdout);
    };
    row("a device, made and destroyed",
        [](const Side &side) { return milliseconds([&] { const gpu::Device device(side.info, kApi); }); });
    const render::RenderScene scene = render::prepareScene(cli::loadScene(std::nullopt), 9);
    const render::BakedScene baked = render::bakeScene(scene.scene, {});
    row("the builds of a scene", [&](const Side &side) {
        return milliseconds([&] { const render::World world(*side.device, scene, baked.micromaps()); });
    });
    for (const render::Trace trace : render::tracesOf(off.info)) {
        render::RenderSettings settings;
        settings.width = 320;
        settings.height = 180;
        settings.trace = trace;
        render::Renderer first(*off.device, scene, baked.micromaps(), settings);
        render::Renderer second(*on.device, scene, baked.micromaps(), settings);
        row(trace == render::Trace::Query ? "a frame by ray queries" : "a frame by a pipeline",
            [&](const Side &side) { return (&side == &off ? first : second).frame(); });
    }
}

void run(const std::vector<std::string> &parts, const std::optional<std::string> &device, unsigned repetitions)
{
    cli::disableShaderCaches();
    const Side off("none", device);
    const gpu::DeviceInfo &info = off.info;
    gpu::requireMicromaps(info, kApi, off.instance->hasLayers());
    fmt::print(
        "{}, {}, medians of {}, milliseconds\n\n| what | validate | off | on | on/off |\n|---|---|--:|--:|--:|\n",
        info.name, info.implementation, repetitions);
    for (const std::string &part : parts)
        compare(off, Side(part.c_str(), device), part.c_str(), repetitions);
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("What validation costs; prints Markdown.", "vellum-validation-bench");
    std::optional<std::filesystem::path> layerFolder;
    std::optional<std::string> device;
    std::vector<std::string> parts{"core", "gpu", "sync", "all"};
    unsigned repetitions = 11;
    app.add_option("parts", parts, "Values of the setting validate")->capture_default_str();
    app.add_option("-r,--repetitions", repetitions, "Measurements of each kind")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000));
    app.add_option("-d,--device", device, "The Vulkan device: a number or a part of its name");
    app.add_option("--layer-path", layerFolder, "Folder of the layer's manifest");
    CLI11_PARSE(app, argc, argv);
    try {
        gpu::offerLayer(layerFolder);
        run(parts, device, repetitions);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-validation-bench: %s\n", error.what());
        return 1;
    }
}
