// vellum-device-bench: what making and destroying a device costs with the layer, against the same without it; and what
// is paid later instead, by a first build of acceleration structures and by a first pipeline that traces rays.
#include <cstdio>
#include <ctime>
#include <functional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/render_command.h"
#include "cli/render_options.h"
#include "creation_bench.h"
#include "side_by_side.h"

namespace
{

using namespace vellum;

// Of all threads of this program; on a CPU driver that is the device's work, too.
double processorMilliseconds(const std::function<void()> &work)
{
    const auto now = [] {
        timespec time{};
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
        return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
    };
    const double begin = now();
    work();
    return now() - begin;
}

// One triangle, so that next to nothing is the scene's.
cli::RenderScene smallestScene()
{
    Scene scene;
    scene.materials.emplace_back();
    Geometry &triangle = scene.geometries.emplace_back();
    triangle.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.uvs.resize(3);
    triangle.indices = {0, 1, 2};
    scene.makeOneMesh();
    return cli::prepareScene(std::move(scene), 1);
}

struct Step {
    const char *name;
    std::function<void(cli::Device &)> work;
};

struct Api {
    const char *name;
    std::optional<cli::MicromapApi> api;
};
constexpr Api kApis[] = {
    {"neither", std::nullopt},
    {"ext", cli::MicromapApi::Ext},
    {"khr", cli::MicromapApi::Khr},
};

void run(const std::optional<std::filesystem::path> &layerFolder, const std::optional<std::string> &wish,
         unsigned repetitions)
{
    bench::disableShaderCaches();
    cli::offerLayer(layerFolder);
    const cli::Instance without(false);
    const cli::Instance with(true);
    const cli::DeviceInfo off = cli::chooseDevice(without, wish);
    const cli::DeviceInfo on = cli::chooseDevice(with, wish);
    const cli::RenderScene scene = smallestScene();
    cli::RenderSettings settings;
    settings.width = settings.height = 8;
    std::vector<Step> steps = {
        {"the device alone", [](cli::Device &) {}},
        {"and a first build", [&](cli::Device &device) { const cli::World world(device, scene, {}); }},
        {"and a first pipeline with ray queries",
         [&](cli::Device &device) { const cli::Renderer renderer(device, scene, {}, settings); }},
    };
    cli::RenderSettings pipelines = settings;
    pipelines.trace = cli::Trace::Pipeline;
    if (on.rayTracingPipelines)
        steps.push_back({"and a first ray tracing pipeline",
                         [&](cli::Device &device) { const cli::Renderer renderer(device, scene, {}, pipelines); }});
    fmt::print("{}, {}, median of {}, milliseconds of CPU\n\n"
               "| what is made and destroyed | extension | layer off | layer on | on - off | on/off |\n"
               "|---|---|--:|--:|--:|--:|\n",
               on.name, on.implementation, repetitions);
    for (const Step &step : steps) {
        for (const Api &api : kApis) {
            if (api.api && !on.has(*api.api))
                continue;
            const auto measure = [&](const cli::DeviceInfo &info, std::optional<cli::MicromapApi> micromaps) {
                return processorMilliseconds([&] {
                    cli::Device device(info, {micromaps, info.rayTracingPipelines});
                    step.work(device);
                });
            };
            bench::SideBySide times;
            for (unsigned r = 0; r < repetitions; ++r)
                times.measure([&] { return measure(off, std::nullopt); }, [&] { return measure(on, api.api); });
            fmt::print("| {} | {} | {:.1f} | {:.1f} | {:.1f} | {:.3f} |\n", step.name, api.name, times.classic(),
                       times.own(), times.own() - times.classic(), times.ratio());
            std::fflush(stdout);
        }
    }
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("What making a device costs with the layer and without; prints Markdown.", "vellum-device-bench");
    std::optional<std::filesystem::path> layerFolder;
    std::optional<std::string> device;
    unsigned repetitions = 21;
    app.add_option("-r,--repetitions", repetitions, "Devices of each kind")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000));
    app.add_option("-d,--device", device, "The Vulkan device: a number or a part of its name");
    app.add_option("--layer-path", layerFolder, "Folder of the layer's manifest");
    CLI11_PARSE(app, argc, argv);
    try {
        run(layerFolder, device, repetitions);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-device-bench: %s\n", error.what());
        return 1;
    }
}
