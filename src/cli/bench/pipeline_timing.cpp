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

std::vector<PipelineTiming> measurePipelines(const TimedDevices &devices, const RenderScene &scene,
                                             const std::vector<Trace> &traces, uint32_t level, unsigned repetitions)
{
    BakeOptions options;
    options.level = level;
    const BakedScene baked = bakeScene(scene.scene, options);
    RenderSettings settings;
    settings.width = settings.height = 32; // the frame itself is to take next to nothing
    std::vector<PipelineTiming> results;
    for (const Trace trace : traces) {
        settings.trace = trace;
        Renderer classic(devices.classic, scene, {}, settings);
        Renderer bare(devices.enabled, scene, {}, settings);
        Renderer omm(devices.enabled, scene, baked.micromaps(), settings);
        PairedTiming without([&] { return classic.firstFrame(); }, [&] { return bare.firstFrame(); });
        PairedTiming with([&] { return classic.firstFrame(); }, [&] { return omm.firstFrame(); });
        for (unsigned r = 0; r < repetitions; ++r) {
            without.measure();
            with.measure();
        }
        for (const PairedTiming *times : {&without, &with})
            results.push_back({trace, times == &with, times->a(), times->b(), times->ratio().middle});
    }
    return results;
}

} // namespace vellum::cli
