// SPDX-License-Identifier: Apache-2.0
// SPIR-V modules in files and streams.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace vellum::cli
{

// Reads a module, from stdin for "-", and checks its structure. Throws Error.
std::vector<uint32_t> readModule(const std::filesystem::path &path);

// What is wrong with the structure of a module; empty if nothing is.
std::string structureError(std::span<const uint32_t> words);

inline std::span<const uint8_t> bytesOf(std::span<const uint32_t> words)
{
    return {reinterpret_cast<const uint8_t *>(words.data()), words.size_bytes()};
}

} // namespace vellum::cli
