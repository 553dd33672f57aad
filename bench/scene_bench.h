// SPDX-License-Identifier: Apache-2.0
// The cost of one scene, with and without micromaps.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "cli/bench/timing.h"
#include "render/baked_scene.h"
#include "render/renderer.h"

namespace vellum::bench
{

struct LevelResult {
    uint32_t level = 0;
    VkDeviceSize bytes = 0;
    double unknown = 0; // share of micro-triangles
    double candidatesPerRay = 0;
    double plainRatio = 0; // frame time omm / alpha
    double heavyRatio = 0; // with 16 more texture reads per candidate
};

struct SceneResult {
    double alphaMilliseconds = 0; // median
    double heavyMilliseconds = 0;
    double candidatesPerRay = 0; // of the alpha test
    std::vector<LevelResult> levels;
    double withoutMicromaps = 0; // frame time: layer on, extension enabled, no micromaps / layer off
};

// Renders each variant `repetitions` times, every frame between two of the alpha test without the layer, to which it is
// compared: the machine's other work hits both. Ratios are medians.
SceneResult measureScene(const cli::TimedDevices &devices, const render::RenderScene &scene,
                         render::RenderSettings settings, const std::vector<uint32_t> &levels, unsigned repetitions,
                         const std::function<void(size_t done, size_t total)> &progress);

} // namespace vellum::bench
