#include "gltf/file/glb.h"

#include <cstring>

namespace vellum
{

std::uint32_t glbWord(std::span<const std::uint8_t> bytes, std::size_t offset)
{
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data() + offset, sizeof word);
    return word;
}

std::optional<GlbChunk> firstGlbChunk(std::span<const std::uint8_t> chunks)
{
    if (chunks.size() < kGlbChunkHeaderBytes)
        return std::nullopt;
    const std::size_t length = glbWord(chunks, 0);
    const auto content = chunks.subspan(kGlbChunkHeaderBytes);
    if (length > content.size())
        return std::nullopt;
    return GlbChunk{glbWord(chunks, 4), content.first(length), content.subspan(length)};
}

} // namespace vellum
