// SPDX-License-Identifier: Apache-2.0
// What the layer adds to the making of pipelines.
#pragma once

#include <vector>

#include "scene_bench.h"

namespace vellum::bench
{

struct CreationResult {
    cli::Trace trace = cli::Trace::Query;
    bool micromaps = false; // of the pipeline with the layer; the one without the layer never has them
    double without = 0;     // median milliseconds, layer off
    double with = 0;        // the same, layer on and extension enabled
    double ratio = 0;       // median
};

// Makes a pipeline and renders one small frame with it, again and again, with the layer and without in turns. Every
// pipeline is new and no pipeline cache is used, but a driver may have a cache of its own: disableShaderCaches.
std::vector<CreationResult> measureCreation(const Devices &devices, const cli::RenderScene &scene,
                                            const std::vector<cli::Trace> &traces, uint32_t level,
                                            unsigned repetitions);

// Tells the drivers of this process to compile every pipeline anew. Before the first Vulkan call.
void disableShaderCaches();

} // namespace vellum::bench
