// SPDX-License-Identifier: Apache-2.0
// The manifests that the Vulkan loader looks for: of drivers and of the layer.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vellum::cli
{

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

} // namespace vellum::cli
