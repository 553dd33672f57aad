// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/timing.h"

#include "base/process.h"
#include "base/statistics.h"
#include "render/baked_scene.h"

namespace vellum::cli
{
namespace
{

std::vector<gpu::Geometry> oneTriangle()
{
    gpu::Geometry geometry;
    gpu::appendTriangle(geometry.vertices, {});
    return {geometry};
}

} // namespace

TimedBuilds::TimedBuilds(gpu::Device &device, std::vector<std::unique_ptr<gpu::Structure>> structures)
    : device_(device), timer_(device), structures_(std::move(structures)), commands_(device.begin(0))
{
    std::vector<const gpu::Structure *> all;
    for (const auto &structure : structures_)
        all.push_back(structure.get());
    const gpu::StructureBuilds builds(device, all);
    timer_.begin(commands_);
    builds.record(commands_);
    timer_.end(commands_);
    device.end(commands_);
    device.execute(commands_);
}

gpu::Milliseconds TimedBuilds::run()
{
    return timer_.time([this] { device_.execute(commands_); });
}

TimedBuilds::Bytes TimedBuilds::bytes() const
{
    Bytes sum;
    for (const auto &structure : structures_) {
        sum.structures += structure->size();
        sum.scratch += structure->scratchRange().size;
    }
    return sum;
}

TimedWorld::TimedWorld(const gpu::DeviceInfo &info, std::optional<gpu::Api> api)
    : device_(info, api), bottom_(device_, oneTriangle())
{
}

std::unique_ptr<TimedBuilds> TimedWorld::top(uint32_t count)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (uint32_t i = 0; i < count; ++i)
        instances.push_back(
            gpu::instance(bottom_, {static_cast<float>(i % 317) * 2, static_cast<float>(i / 317) * 2, 0}, 0));
    auto top = std::make_unique<gpu::Tlas>(device_);
    top->prepare(instances);
    std::vector<std::unique_ptr<gpu::Structure>> one;
    one.push_back(std::move(top));
    return std::make_unique<TimedBuilds>(device_, std::move(one));
}

std::unique_ptr<TimedBuilds> TimedWorld::bottoms(uint32_t count)
{
    std::vector<std::unique_ptr<gpu::Structure>> many;
    for (uint32_t i = 0; i < count; ++i) {
        auto bottom = std::make_unique<gpu::Blas>(device_);
        bottom->prepare(oneTriangle());
        many.push_back(std::move(bottom));
    }
    return std::make_unique<TimedBuilds>(device_, std::move(many));
}

void disableShaderCaches()
{
    setVariable("MESA_SHADER_CACHE_DISABLE", "true"); // Mesa
    setVariable("__GL_SHADER_DISK_CACHE", "0");       // NVIDIA
}

std::array<PipelineTiming, 2> measurePipelines(const TimedDevices &devices, const render::RenderScene &scene,
                                               render::Trace trace, uint32_t level,
                                               const std::function<void()> &progress,
                                               const std::function<bool(size_t pairs)> &goOn)
{
    BakeOptions options;
    options.level = level;
    const render::BakedScene baked = render::bakeScene(scene.scene, options);
    render::RenderSettings settings;
    settings.width = settings.height = 32; // the frame itself is to take next to nothing
    settings.trace = trace;
    render::Renderer alpha(devices.bare, scene, {}, settings);
    render::Renderer layered(devices.layered, scene, {}, settings);
    render::Renderer micromaps(devices.layered, scene, baked.micromaps(), settings);
    const auto timed = [&](render::Renderer &renderer) {
        return [&] {
            const double milliseconds = renderer.firstFrame();
            progress();
            return milliseconds;
        };
    };
    PairedTiming without(timed(alpha), timed(layered));
    PairedTiming with(timed(alpha), timed(micromaps));
    do {
        without.measure();
        with.measure();
    } while (goOn(with.pairs()));
    const auto timing = [&](const PairedTiming &times, bool hasMicromaps) {
        return PipelineTiming{trace, hasMicromaps, times.a(), times.b(), times.ratio().middle};
    };
    return {timing(without, false), timing(with, true)};
}

} // namespace vellum::cli
