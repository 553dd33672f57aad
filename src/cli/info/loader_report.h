// SPDX-License-Identifier: Apache-2.0
// The state of this machine: the Vulkan loader, the layer, drivers, devices.
#pragma once

#include <optional>

#include "base/json_writer.h"
#include "cli/info/device_details.h"
#include "cli/info/manifests.h"

namespace vellum::cli
{

struct LoaderReport {
    std::string loaderVersion;
    std::vector<Manifest> drivers;
    std::vector<Manifest> layers;   // manifests of the layer
    bool layerFound = false;        // by the loader, in the environment as it is
    bool layerOnByVariable = false; // VK_INSTANCE_LAYERS or VK_LOADER_LAYERS_ENABLE name it
    bool layerLoads = false;
    // Shell commands that enable the layer for a program; only those that are needed.
    std::vector<std::string> turnOn;
    std::vector<DeviceDetails> devices; // with the layer, where it loads
    // Why there are no micromaps, one line each; empty if there are.
    std::vector<std::string> problems;
};

// `folder`: of the layer's manifest, instead of the one installed with this program. Changes the environment as
// addLayerFolder does.
LoaderReport reportLoader(const std::optional<std::filesystem::path> &folder);

void print(const LoaderReport &report);
void write(const LoaderReport &report, JsonWriter &json);

} // namespace vellum::cli
