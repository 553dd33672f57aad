// SPDX-License-Identifier: Apache-2.0
// `vellum render`
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "bake/bake.h"
#include "render/renderer.h"

namespace vellum::cli
{

enum class Mode { Alpha, Micromaps, Compare, States, Heat };

struct RenderOptions {
    std::optional<std::filesystem::path> input; // the built-in grove without
    std::filesystem::path output;
    Mode mode = Mode::Micromaps;
    gpu::Api api = gpu::Api::Khr;
    render::RenderSettings settings;
    std::optional<render::Trace> trace; // instead of the first that the device has
    BakeOptions bake;
    bool blend = false;               // bakes alphaMode BLEND as well
    std::optional<float> blendCutoff; // as a mask
    uint32_t instances = 1;
    std::optional<uint32_t> frames; // to time, or pairs of them; without, as many as it takes
    bool bakeAnew = false;          // even if the file has micromaps
    // Draws to the left, with Mode::States the picture by micromaps, with Mode::Heat the map without them.
    bool sideBySide = false;
    bool force = false; // replaces any file
    bool json = false;  // with Mode::Compare
    bool quiet = false;
    gpu::DeviceSelection device;
    bool layer = true;
    std::optional<std::filesystem::path> layerFolder; // instead of the one next to the program
};

// The values of --api.
const std::map<std::string, gpu::Api> &micromapApis();

// "1280x720". Throws UsageError.
void parseSize(const std::string &text, render::RenderSettings &settings);

// Renders, writes the pictures and prints what was done on stdout. Returns the exit code.
int renderCommand(RenderOptions options);

// The scene of a file, or the grove.
Scene loadScene(const std::optional<std::filesystem::path> &file);

} // namespace vellum::cli
