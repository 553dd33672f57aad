// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/container.h"

#include <cstring>
#include <tuple>

#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"
#include "gltf/file/uri.h"

namespace vellum
{
namespace
{

constexpr size_t kJsonOffset = kGlbHeaderBytes + kGlbChunkHeaderBytes;

// Checks the chunk at `offset` of a GLB of this length. Returns the offset of the next one.
size_t endOfChunk(std::span<const uint8_t> bytes, size_t offset, size_t length)
{
    if (length - offset < kGlbChunkHeaderBytes)
        throw GltfError("truncated inside a chunk header");
    const size_t chunk = glbWord(bytes, offset);
    if (chunk > length - offset - kGlbChunkHeaderBytes)
        throw GltfError("a GLB chunk of " + std::to_string(chunk) + " bytes ends outside of the file");
    return offset + kGlbChunkHeaderBytes + chunk;
}

// Checks the header of a GLB in a file of this size, and its first chunk. `bytes`: at least the first 20 if the file
// has them. Returns where the JSON text is.
std::pair<size_t, size_t> checkHeader(std::span<const uint8_t> bytes, uint64_t fileSize)
{
    if (fileSize < kJsonOffset)
        throw GltfError("truncated: " + std::to_string(fileSize) + " bytes are too short for a GLB header");
    if (glbWord(bytes, 4) != 2)
        throw GltfError("GLB version " + std::to_string(glbWord(bytes, 4)) + " is not 2");
    const size_t length = glbWord(bytes, 8);
    if (length > fileSize)
        throw GltfError("truncated: the header announces " + std::to_string(length) + " bytes, there are " +
                        std::to_string(fileSize));
    if (length < kJsonOffset)
        throw GltfError("truncated: the header announces " + std::to_string(length) + " bytes");
    if (glbWord(bytes, 16) != kGlbJson)
        throw GltfError("the first GLB chunk is not JSON");
    return {kJsonOffset, endOfChunk(bytes, kGlbHeaderBytes, length) - kJsonOffset};
}

// Checks that all chunks are inside the length that the header announces. Returns where the JSON text is.
std::pair<size_t, size_t> checkGlb(std::span<const uint8_t> bytes)
{
    const auto json = checkHeader(bytes, bytes.size());
    const size_t length = glbWord(bytes, 8);
    for (size_t offset = json.first + json.second; offset < length;)
        offset = endOfChunk(bytes, offset, length);
    return json;
}

bool isGlb(std::span<const uint8_t> bytes)
{
    return bytes.size() >= 4 && glbWord(bytes, 0) == kGlbMagic;
}

// Parsers walk JSON recursively, where thousands of levels would overflow the stack, and an empty list of 2 bytes takes
// dozens in memory.
void checkStructure(std::string_view text)
{
    constexpr int kMostDepth = 128;
    constexpr size_t kMostLists = size_t{4} << 20;
    constexpr size_t kMostCommas = size_t{8} << 20;
    int depth = 0;
    size_t lists = 0; // objects, too
    size_t commas = 0;
    bool quoted = false;
    for (size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (quoted) {
            if (c == '\\')
                ++i;
            else if (c == '"')
                quoted = false;
            continue;
        }
        if (c == '"') {
            quoted = true;
        } else if (c == '{' || c == '[') {
            ++depth;
            ++lists;
        } else if (c == '}' || c == ']') {
            --depth;
        } else if (c == ',') {
            ++commas;
        }
        if (depth > kMostDepth)
            throw GltfError("the JSON is nested too deeply");
    }
    if (lists > kMostLists || commas > kMostCommas)
        throw GltfError("there are too many objects in it");
}

} // namespace

Container readJson(const std::filesystem::path &path)
{
    InputFile file(path);
    checkSize(file.size());
    std::vector<uint8_t> start(kJsonOffset);
    start.resize(file.read(start));
    if (!isGlb(start))
        return findContainer(readWholeFile(path));
    Container container{.bytes = std::move(start), .fileBytes = file.size(), .binary = true};
    std::tie(container.jsonOffset, container.jsonSize) = checkHeader(container.bytes, file.size());
    container.bytes.resize(container.jsonOffset + container.jsonSize);
    if (file.read(std::span(container.bytes).subspan(container.jsonOffset)) != container.jsonSize)
        throw GltfError("cannot be read");
    checkStructure(container.json());
    return container;
}

Container findContainer(std::vector<uint8_t> file)
{
    const size_t fileBytes = file.size();
    Container container{.bytes = std::move(file), .fileBytes = fileBytes};
    const std::vector<uint8_t> &bytes = container.bytes;
    if (bytes.empty())
        throw GltfError("the file is empty");
    const char *text = reinterpret_cast<const char *>(bytes.data());
    container.binary = isGlb(bytes);
    if (container.binary) {
        std::tie(container.jsonOffset, container.jsonSize) = checkGlb(bytes);
        container.bytes.resize(glbWord(bytes, 8));
    } else {
        const size_t start = std::string_view(text, bytes.size()).find_first_not_of(" \t\r\n\xef\xbb\xbf");
        if (start == std::string_view::npos || text[start] != '{')
            throw GltfError("neither a GLB nor a glTF file");
        container.jsonSize = bytes.size();
    }
    checkStructure(container.json());
    return container;
}

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
