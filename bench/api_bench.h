// SPDX-License-Identifier: Apache-2.0
// VK_KHR_opacity_micromap against VK_EXT_opacity_micromap: the same frames, by micromaps made with each.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "render/renderer.h"

namespace vellum::bench
{

// Both are of an instance with the layer; each has its extension enabled.
struct ApiDevices {
    gpu::Device &khr;
    gpu::Device &ext;
};

struct ApiResult {
    uint32_t level = 0;
    bool heavy = false;
    double candidatesPerRay[2] = {}; // with KHR, with EXT
    VkDeviceSize bytes[2] = {};
    double milliseconds[2] = {}; // medians
    double ratio = 0;            // frame time khr / ext, median
    size_t differingPixels = 0;
};

// Each frame with KHR lies between two with EXT.
std::vector<ApiResult> compareApis(const ApiDevices &devices, const render::RenderScene &scene,
                                   render::RenderSettings settings, const std::vector<uint32_t> &levels,
                                   unsigned repetitions,
                                   const std::function<void(size_t done, size_t total)> &progress);

} // namespace vellum::bench
