// SPDX-License-Identifier: Apache-2.0
// What the layer adds to the making of pipelines.
#pragma once

#include <vector>

#include "cli/renderer/renderer.h"

namespace vellum::cli
{

// The devices to compare: `classic` of an instance without the layer and without micromaps, `enabled` with both.
struct TimedDevices {
    Device &classic;
    Device &enabled;
};

struct PipelineTiming {
    Trace trace = Trace::Query;
    bool micromaps = false; // of the pipeline on `enabled`; the other one never has them
    double classic = 0;     // median milliseconds
    double enabled = 0;
    double ratio = 0; // median
};

// Makes a pipeline and renders one small frame with it, again and again, on both devices in turns. Every pipeline is
// new and no pipeline cache is used, but a driver may have a cache of its own: disableShaderCaches.
std::vector<PipelineTiming> measurePipelines(const TimedDevices &devices, const RenderScene &scene,
                                             const std::vector<Trace> &traces, uint32_t level, unsigned repetitions);

// Tells the drivers of this process to compile every pipeline anew. Before the first Vulkan call.
void disableShaderCaches();

} // namespace vellum::cli
