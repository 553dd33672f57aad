// SPDX-License-Identifier: Apache-2.0
// The layers of the folders that VK_LAYER_PATH or, without it, VK_ADD_LAYER_PATH names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::loader
{

struct Manifest {
    VkLayerProperties properties{};
    std::filesystem::path library;
    std::vector<VkExtensionProperties> instanceExtensions;
    std::vector<VkExtensionProperties> deviceExtensions;
};

std::vector<Manifest> findManifests();
// The names in VK_INSTANCE_LAYERS.
std::vector<std::string> layersByVariable();

} // namespace vellum::loader
