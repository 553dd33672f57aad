// SPDX-License-Identifier: Apache-2.0
// Finds the layer next to the command, and turns it on without an installation.
#pragma once

#include <filesystem>
#include <optional>

namespace vellum::gpu
{

inline constexpr const char *kLayerName = "VK_LAYER_VELLUM_opacity_micromap";

// The folder with the layer's manifest next to this program: the program's own in the archive for Windows, <build>/lib
// in a build tree, or <prefix>/share/vulkan/explicit_layer.d after installation. Nothing if there is no manifest.
std::optional<std::filesystem::path> findLayerFolder();

// Adds a folder to those in which the Vulkan loader looks for explicit layers. Before the first Vulkan call.
void addLayerFolder(const std::filesystem::path &folder);
// Adds the given folder, or the one next to this program, to the loader's path. Does nothing if there is no manifest;
// the layer may be installed.
void offerLayer(const std::optional<std::filesystem::path> &folder);

// Removes the layer from the variables that turn it on in every program, VK_INSTANCE_LAYERS and
// VK_LOADER_LAYERS_ENABLE, and has loaders of 1.3.234 and newer disable it where something else turns it on. Before the
// first Vulkan call.
void withdrawLayer();

} // namespace vellum::gpu
