// SPDX-License-Identifier: Apache-2.0
// vellum-device-bench: what making and destroying a device costs with the layer, against the same without it; and what
// is paid later instead, by a first build of acceleration structures and by a first pipeline that traces rays.
#include <cstdio>
#include <functional>

#include <fmt/format.h>

#include "base/statistics.h"
#include "cli/render_command.h"
#include "gpu/scene.h"
#include "layer_comparison.h"
#include "process_times.h"

namespace
{

using namespace vellum;

double processorMilliseconds(const std::function<void()> &work)
{
    const double begin = bench::processorSeconds();
    work();
    return 1e3 * (bench::processorSeconds() - begin);
}

// One triangle, so that the scene takes almost no time.
render::RenderScene smallestScene()
{
    Scene scene;
    scene.materials.emplace_back();
    Geometry &triangle = scene.geometries.emplace_back();
    triangle.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.uvs.resize(3);
    triangle.indices = {0, 1, 2};
    scene.makeOneMesh();
    return render::prepareScene(std::move(scene), 1);
}

// A first build of a micromap: of one triangle, of level 4. `behind`: bytes in the buffer of the data after it.
// `compacted`: a query of the compacted size and a compacting copy follow.
void buildMicromap(gpu::Device &device, VkBuildMicromapFlagsEXT flags, size_t behind = 0, bool compacted = false)
{
    gpu::MicromapInput input;
    input.add(4, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT, std::vector<uint8_t>(256, 1));
    input.data.resize(input.data.size() + behind);
    gpu::Micromap micromap(device, std::move(input), flags);
    micromap.build();
    if (!compacted)
        return;
    const VkDeviceSize size = queryMicromap(device, micromap.handle(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    const gpu::Micromap copy(device, micromap, size);
    device.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(device, commands, micromap.handle(), copy.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
}

struct Step {
    const char *name;
    std::function<void(gpu::Device &)> work;
    bool usesMicromaps = false; // and without the layer does nothing
};

struct Api {
    const char *name;
    std::optional<gpu::Api> api;
};
constexpr Api kApis[] = {
    {"neither", std::nullopt},
    {"ext", gpu::Api::Ext},
    {"khr", gpu::Api::Khr},
};

void run(const gpu::DeviceInfo &off, const gpu::DeviceInfo &on, unsigned repetitions)
{
    const render::RenderScene scene = smallestScene();
    render::RenderSettings settings;
    settings.width = settings.height = 8;
    std::vector<Step> steps = {
        {"the device alone", [](gpu::Device &) {}},
        {"and a first micromap build", [](gpu::Device &device) { buildMicromap(device, 0); }, true},
        {"and a first micromap build, of data in a larger buffer",
         [](gpu::Device &device) { buildMicromap(device, 0, 4096); }, true},
        {"and a first micromap build with ALLOW_COMPACTION",
         [](gpu::Device &device) { buildMicromap(device, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT); }, true},
        {"and its compacted size and compacted copy",
         [](gpu::Device &device) { buildMicromap(device, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT, 0, true); }, true},
        {"and a first build of a structure",
         [&](gpu::Device &device) { const render::World world(device, scene, {}); }},
    };
    for (const render::Trace trace : render::tracesOf(on)) {
        settings.trace = trace;
        steps.push_back({trace == render::Trace::Query ? "and a first pipeline with ray queries"
                                                       : "and a first ray tracing pipeline",
                         [&scene, settings](gpu::Device &device) {
                             const render::Renderer renderer(device, scene, {}, settings);
                         }});
    }
    fmt::print("{}, {}, median of {}, milliseconds of CPU\n\n"
               "| what is made and destroyed | extension | layer off | layer on | on - off | on/off |\n"
               "|---|---|--:|--:|--:|--:|\n",
               on.name, on.implementation, repetitions);
    for (const Step &step : steps) {
        for (const Api &api : kApis) {
            if (api.api ? !on.has(*api.api) : step.usesMicromaps)
                continue;
            const auto measure = [&](const gpu::DeviceInfo &info, std::optional<gpu::Api> micromaps) {
                return processorMilliseconds([&] {
                    gpu::Device device(info, micromaps);
                    if (micromaps || !step.usesMicromaps)
                        step.work(device);
                });
            };
            PairedTiming times([&] { return measure(off, std::nullopt); }, [&] { return measure(on, api.api); });
            for (unsigned r = 0; r < repetitions; ++r)
                times.measure();
            fmt::print("| {} | {} | {:.1f} | {:.1f} | {:.1f} | {:.3f} |\n", step.name, api.name, times.a(), times.b(),
                       times.b() - times.a(), times.ratio().middle);
            std::fflush(stdout);
        }
    }
}

} // namespace

int main(int argc, char **argv)
{
    return bench::compareDevices(argc, argv, "vellum-device-bench",
                                 "What making a device costs with the layer and without; prints Markdown.",
                                 "Devices of each kind", run);
}
