// Pictures, and PNG files of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace vellum::cli
{

struct Picture {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint32_t> pixels; // RGBA, red in the lowest byte, top row first
};

// Throws Error where a picture could not be written to `path` later: so that nobody waits for one in vain.
void checkWritable(const std::filesystem::path &path);

enum class Colors { All, Few }; // Few: at most 256, for a small file

// Writes beside `path` and renames: whatever happens, `path` is never half of a picture. Throws Error.
void writePng(const std::filesystem::path &path, const Picture &picture, Colors colors = Colors::All);

// Both pictures must have the same height.
Picture sideBySide(const Picture &left, const Picture &right);

struct Difference {
    std::uint64_t pixels = 0;  // that differ in any channel
    std::uint32_t largest = 0; // of any channel, 1..255
    Picture amplified;         // eight times the absolute difference on black, any difference visible
};

// Both pictures must have the same size.
Difference compare(const Picture &a, const Picture &b);

} // namespace vellum::cli
