// SPDX-License-Identifier: Apache-2.0
// The parts of a GLB (glTF 2.0, 4.4 "GLB File Format Specification").
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace vellum
{

constexpr size_t kGlbHeaderBytes = 12;     // magic, version, length
constexpr size_t kGlbChunkHeaderBytes = 8; // length, type
constexpr uint32_t kGlbMagic = 0x46546c67;
constexpr uint32_t kGlbJson = 0x4e4f534a;   // the type of the chunk with the JSON
constexpr uint32_t kGlbBinary = 0x004e4942; // of the chunk that is the first buffer, where that has no URI

uint32_t glbWord(std::span<const uint8_t> bytes, size_t offset);

struct GlbChunk {
    uint32_t type = 0;
    std::span<const uint8_t> data;
    std::span<const uint8_t> rest; // what follows it
};

// The chunk that `chunks` begin with; none where they are too short for it.
std::optional<GlbChunk> firstGlbChunk(std::span<const uint8_t> chunks);

} // namespace vellum
