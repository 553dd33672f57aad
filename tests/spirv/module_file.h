// SPDX-License-Identifier: Apache-2.0
// Reads SPIR-V modules from the build tree.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace vellum::test
{

// True if the file is a module (.spv), or a C array (.h) with the words of one, as the build generates it from a
// shader.
bool isModuleFile(const std::filesystem::path &file);

// Throws std::runtime_error unless the file contains words.
std::vector<uint32_t> readModule(const std::filesystem::path &file);

// The files that contain the project's own shaders: those in a list, one a line (shaders.txt, cmake/glsl.cmake).
std::vector<std::filesystem::path> listedModules(const std::filesystem::path &list);

} // namespace vellum::test
