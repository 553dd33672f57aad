// SPDX-License-Identifier: Apache-2.0
// The state of this machine: the Vulkan loader, the layer, drivers, devices; and the manifests that the loader looks
// for.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "cli/info/device_details.h"

namespace vellum::cli
{

// The manifests that the Vulkan loader looks for: of drivers and of the layer.
struct Manifest {
    std::filesystem::path path;
    std::filesystem::path library; // named by the manifest, absolute; a bare name is looked up by the system
    std::string from;              // why it is looked at: "VK_DRIVER_FILES", "/usr/share/vulkan/icd.d"
    std::string problem;           // why it cannot work; empty where none is known
};

// The manifests of drivers: those that VK_DRIVER_FILES or VK_ICD_FILENAMES names, or else those in the loader's
// folders, and those of VK_ADD_DRIVER_FILES.
std::vector<Manifest> findDriverManifests();

// The manifests of the layer, in all folders in which the loader looks for explicit layers, and in `folder` (the one
// next to this program), in that order.
std::vector<Manifest> findLayerManifests(const std::filesystem::path &folder);

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
