// SPDX-License-Identifier: Apache-2.0
// From a file to its bytes, and to the JSON in them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace vellum
{

// A glTF file as it is stored.
struct Container {
    std::vector<uint8_t> bytes;
    bool binary = false; // a GLB
    // The JSON text.
    size_t jsonOffset = 0;
    size_t jsonSize = 0;

    [[nodiscard]] std::string_view json() const
    {
        return {reinterpret_cast<const char *>(bytes.data()) + jsonOffset, jsonSize};
    }
};

// Finds the JSON text in the bytes of a file. Throws GltfError, also for chunks that contradict themselves and JSON
// that no parser should see.
Container findContainer(std::vector<uint8_t> bytes);
// The same for a file.
Container readContainer(const std::filesystem::path &path);

} // namespace vellum
