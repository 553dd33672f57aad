// Files that are written whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace vellum::cli
{

// Throws Error where a file could not be written to `path` later: so that nobody waits for one in vain.
void checkWritable(const std::filesystem::path &path);

// The file appears whole, whatever happens. Throws Error.
void writeWhole(const std::filesystem::path &path, std::span<const uint8_t> bytes);

} // namespace vellum::cli
