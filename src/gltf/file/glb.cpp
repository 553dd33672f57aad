// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/glb.h"

#include <cstring>

namespace vellum
{

uint32_t glbWord(std::span<const uint8_t> bytes, size_t offset)
{
    uint32_t word = 0;
    std::memcpy(&word, bytes.data() + offset, sizeof word);
    return word;
}

std::optional<GlbChunk> firstGlbChunk(std::span<const uint8_t> chunks)
{
    if (chunks.size() < kGlbChunkHeaderBytes)
        return std::nullopt;
    const size_t length = glbWord(chunks, 0);
    const auto content = chunks.subspan(kGlbChunkHeaderBytes);
    if (length > content.size())
        return std::nullopt;
    return GlbChunk{glbWord(chunks, 4), content.first(length), content.subspan(length)};
}

} // namespace vellum
