// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/pipeline_timing.h"

#include <cstdlib>

#include "cli/base/paired_timing.h"
#include "cli/base/system/this_process.h"
#include "cli/scene/baked_scene.h"

namespace vellum::cli
{

void disableShaderCaches()
{
    setVariable("MESA_SHADER_CACHE_DISABLE", "true"); // Mesa
    setVariable("__GL_SHADER_DISK_CACHE", "0");       // NVIDIA
}

std::array<PipelineTiming, 2> measurePipelines(const TimedDevices &devices, const RenderScene &scene, Trace trace,
                                               uint32_t level, const std::function<void()> &progress,
                                               const std::function<bool(size_t pairs)> &goOn)
{
    BakeOptions options;
    options.level = level;
    const BakedScene baked = bakeScene(scene.scene, options);
    RenderSettings settings;
    settings.width = settings.height = 32; // the frame itself is to take next to nothing
    settings.trace = trace;
    Renderer alpha(devices.bare, scene, {}, settings);
    Renderer layered(devices.layered, scene, {}, settings);
    Renderer micromaps(devices.layered, scene, baked.micromaps(), settings);
    const auto timed = [&](Renderer &renderer) {
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
