// SPDX-License-Identifier: Apache-2.0
// Files that are named on the command line.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vellum::cli
{

// The whole file, which may be a pipe but not a directory. Throws Error, with the path in front.
std::string readFile(const std::filesystem::path &path);

// Whether `path` is `folder` or below it, by their names.
bool isInside(const std::filesystem::path &path, const std::filesystem::path &folder);

// The .glb and .gltf files in a folder and in all folders in it, except those in `except`, by name. Throws Error.
std::vector<std::filesystem::path> gltfFilesIn(const std::filesystem::path &folder,
                                               const std::filesystem::path &except = {});

// Each file, and in place of each folder the glTF files in it. Throws Error for a folder without any.
std::vector<std::filesystem::path> gltfFiles(const std::vector<std::filesystem::path> &operands);

} // namespace vellum::cli
