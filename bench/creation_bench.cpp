// SPDX-License-Identifier: Apache-2.0
#include "creation_bench.h"

#include <cstdlib>

#include "side_by_side.h"

namespace vellum::bench
{

void disableShaderCaches()
{
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1); // Mesa
    setenv("__GL_SHADER_DISK_CACHE", "0", 1);       // NVIDIA
}

std::vector<CreationResult> measureCreation(const Devices &devices, const cli::RenderScene &scene,
                                            const std::vector<cli::Trace> &traces, uint32_t level, unsigned repetitions)
{
    BakeOptions options;
    options.level = level;
    const cli::BakedScene baked = cli::bakeScene(scene.scene, options);
    cli::RenderSettings settings;
    settings.width = settings.height = 32; // the frame itself is to take next to nothing
    std::vector<CreationResult> results;
    for (const cli::Trace trace : traces) {
        settings.trace = trace;
        cli::Renderer classic(devices.classic, scene, {}, settings);
        cli::Renderer bare(devices.enabled, scene, {}, settings);
        cli::Renderer omm(devices.enabled, scene, baked.micromaps(), settings);
        SideBySide times[2];
        for (unsigned r = 0; r < repetitions; ++r) {
            times[0].measure([&] { return classic.firstFrame(); }, [&] { return bare.firstFrame(); });
            times[1].measure([&] { return classic.firstFrame(); }, [&] { return omm.firstFrame(); });
        }
        for (const bool micromaps : {false, true}) {
            const SideBySide &t = times[micromaps ? 1 : 0];
            results.push_back({trace, micromaps, t.classic(), t.own(), t.ratio()});
        }
    }
    return results;
}

} // namespace vellum::bench
