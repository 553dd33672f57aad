// SPDX-License-Identifier: Apache-2.0
// Reads the bytes of a file, and the JSON in them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace vellum
{

// A glTF file as it is stored.
struct Container {
    std::vector<uint8_t> bytes; // without those after the length that a GLB announces
    uint64_t fileBytes = 0;     // with them
    bool binary = false;        // a GLB
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
// Reads a file up to the end of its JSON text: of a GLB the header and the first chunk. The other chunks are not read
// and not checked. Throws GltfError.
Container readJson(const std::filesystem::path &path);

constexpr size_t kGlbHeaderBytes = 12;     // magic, version, length
constexpr size_t kGlbChunkHeaderBytes = 8; // length, type
constexpr uint32_t kGlbMagic = 0x46546c67;
constexpr uint32_t kGlbJson = 0x4e4f534a;   // the type of the chunk with the JSON
constexpr uint32_t kGlbBinary = 0x004e4942; // of the chunk that is the first buffer, where that has no URI

uint32_t glbWord(std::span<const uint8_t> bytes, size_t offset);

struct GlbChunk {
    uint32_t type = 0;
    std::span<const uint8_t> data;
    std::span<const uint8_t> rest; // the bytes after it
};

// The chunk that `chunks` begin with; none where they are too short for it.
std::optional<GlbChunk> firstGlbChunk(std::span<const uint8_t> chunks);

} // namespace vellum
