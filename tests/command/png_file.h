// SPDX-License-Identifier: Apache-2.0
// Reads the PNGs that the command writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace vellum::test
{

struct Rgb {
    int red = 0, green = 0, blue = 0;
    bool operator==(const Rgb &) const = default;
};

struct Png {
    size_t width = 0;
    size_t height = 0;
    std::vector<Rgb> pixels; // top row first
};

// Throws std::runtime_error.
Png readPng(const std::filesystem::path &path);

} // namespace vellum::test
