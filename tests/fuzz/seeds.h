// SPDX-License-Identifier: Apache-2.0
// Inputs that fuzzing begins with, one file each, in a folder that exists.
#pragma once

#include <filesystem>

// Seeds for the glTF reader: files with a part of every kind.
void writeGltfSeeds(const std::filesystem::path &folder);

// Seeds for the rewriter: the modules in a list of files (spirv/module_file.h) and those in a folder.
void writeSpirvSeeds(const std::filesystem::path &list, const std::filesystem::path &modules,
                     const std::filesystem::path &folder);
