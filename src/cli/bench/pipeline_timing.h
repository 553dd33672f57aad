// SPDX-License-Identifier: Apache-2.0
// What the layer adds to the making of pipelines.
#pragma once

#include <array>
#include <functional>

#include "cli/renderer/renderer.h"

namespace vellum::cli
{

// The devices to compare: `bare` of an instance without the layer and without micromaps, `layered` with both.
struct TimedDevices {
    Device &bare;
    Device &layered;
};

struct PipelineTiming {
    Trace trace = Trace::Query;
    bool micromaps = false; // of the pipeline on `layered`; the other one never has them
    double bare = 0;        // median milliseconds
    double layered = 0;
    double ratio = 0; // median
};

// Makes a pipeline and renders one small frame with it, on both devices in turns, as long as `goOn` returns true. Every
// pipeline is new and no pipeline cache is used, but a driver may have a cache of its own: disableShaderCaches.
// Without micromaps and with them. Calls `progress` after each pipeline.
std::array<PipelineTiming, 2> measurePipelines(const TimedDevices &devices, const RenderScene &scene, Trace trace,
                                               uint32_t level, const std::function<void()> &progress,
                                               const std::function<bool(size_t pairs)> &goOn);

// Tells the drivers of this process to compile every pipeline anew. Before the first Vulkan call.
void disableShaderCaches();

} // namespace vellum::cli
