// SPDX-License-Identifier: Apache-2.0
// Uses stb_image, in builds without the image libraries: PNG and JPEG.
#include <array>
#include <cstdlib>
#include <memory>
#include <new>
#include <string>
#include <string_view>

#include "gltf/data/image_formats.h"

namespace
{

// An allocation failed since this was cleared. stb_image itself may report it as a fault of the image.
thread_local bool outOfMemory = false;

void *noted(void *memory)
{
    outOfMemory = outOfMemory || memory == nullptr;
    return memory;
}

} // namespace

#define STBI_MALLOC(size) noted(std::malloc(size))
#define STBI_REALLOC(memory, size) noted(std::realloc(memory, size))
#define STBI_FREE(memory) std::free(memory)
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_HDR
#define STBI_MAX_DIMENSIONS 16384
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb_image.h>
#pragma GCC diagnostic pop

namespace vellum
{
namespace
{

static_assert(STBI_MAX_DIMENSIONS == kMostTexels);

struct Free {
    void operator()(void *memory) const { stbi_image_free(memory); }
};

int lengthOf(Encoded encoded, const std::string &what)
{
    if (encoded.size() > 0x7fffffff)
        failToDecode(what, "it is larger than 2 GiB");
    return static_cast<int>(encoded.size());
}

[[noreturn]] void failByLibrary(const std::string &what)
{
    const char *given = stbi_failure_reason();
    const std::string reason = given ? given : "unknown reason";
    if (outOfMemory || reason == "outofmem")
        throw std::bad_alloc();
    failToDecode(what, reason);
}

// The size by its header.
Image withoutTexels(Encoded encoded, const std::string &what)
{
    outOfMemory = false;
    int width = 0;
    int height = 0;
    int channels = 0;
    if (!stbi_info_from_memory(encoded.data(), lengthOf(encoded, what), &width, &height, &channels))
        failByLibrary(what);
    return imageOf(static_cast<uint64_t>(width), static_cast<uint64_t>(height), encoded, what);
}

// Decodes four channels with stbi_load_from_memory() or its variant for 16 bits.
template <typename Channel>
std::unique_ptr<Channel, Free> texelsBy(Channel *load(const stbi_uc *, int, int *, int *, int *, int), Encoded encoded,
                                        const std::string &what)
{
    outOfMemory = false;
    int width = 0;
    int height = 0;
    int channels = 0;
    std::unique_ptr<Channel, Free> texels(load(encoded.data(), lengthOf(encoded, what), &width, &height, &channels, 4));
    if (!texels)
        failByLibrary(what);
    return texels;
}

Image withTexels(Image image, Encoded encoded, const std::string &what)
{
    const auto texels = texelsBy(stbi_load_from_memory, encoded, what);
    image.rgba.assign(texels.get(), texels.get() + size_t{4} * image.width * image.height);
    return image;
}

Image withWideTexels(Image image, Encoded encoded, const std::string &what)
{
    const auto texels = texelsBy(stbi_load_16_from_memory, encoded, what);
    std::vector<uint8_t> rows(size_t{8} * image.width * image.height);
    for (size_t i = 0; i < rows.size() / 2; ++i) {
        rows[2 * i] = static_cast<uint8_t>(texels.get()[i] >> 8);
        rows[2 * i + 1] = static_cast<uint8_t>(texels.get()[i] & 0xff);
    }
    takeWide(rows, image);
    return image;
}

uint32_t wordAt(Encoded bytes, size_t at)
{
    return uint32_t{bytes[at]} << 24 | uint32_t{bytes[at + 1]} << 16 | uint32_t{bytes[at + 2]} << 8 | bytes[at + 3];
}

// The CRC of a PNG's chunks (ISO 3309).
uint32_t checksumOf(Encoded bytes)
{
    static constexpr auto kTable = [] {
        std::array<uint32_t, 256> table{};
        for (uint32_t i = 0; i < table.size(); ++i) {
            uint32_t rest = i;
            for (int bit = 0; bit < 8; ++bit)
                rest = (rest & 1) != 0 ? rest >> 1 ^ 0xedb88320 : rest >> 1;
            table[i] = rest;
        }
        return table;
    }();
    uint32_t sum = 0xffffffff;
    for (const uint8_t byte : bytes)
        sum = kTable[(sum ^ byte) & 0xff] ^ sum >> 8;
    return ~sum;
}

// All chunks are there, and those with texels are as they were written, which the library does not check.
void checkPng(Encoded encoded, const std::string &what)
{
    constexpr size_t kAround = 12; // length, type and checksum
    std::string_view type;
    for (size_t at = 8; type != "IEND";) {
        if (encoded.size() - at < kAround || wordAt(encoded, at) > encoded.size() - at - kAround)
            failToDecode(what, "it is cut off");
        const uint32_t length = wordAt(encoded, at);
        const Encoded checked = encoded.subspan(at + 4, size_t{4} + length);
        type = {reinterpret_cast<const char *>(checked.data()), 4};
        const bool ancillary = (type[0] & 0x20) != 0;
        if (!ancillary && checksumOf(checked) != wordAt(encoded, at + 8 + length))
            failToDecode(what, "it is damaged");
        at += kAround + length;
    }
}

} // namespace

const bool kDecodesWebpAndAvif = false;

Image readPng(Encoded encoded, const std::string &what)
{
    checkPng(encoded, what);
    Image image = withoutTexels(encoded, what);
    const bool wide = stbi_is_16_bit_from_memory(encoded.data(), lengthOf(encoded, what)) != 0;
    // A texel takes at least one bit.
    checkDeflated(uint64_t{image.width} * image.height / 8, encoded, what);
    return wide ? withWideTexels(std::move(image), encoded, what) : withTexels(std::move(image), encoded, what);
}

Image readJpeg(Encoded encoded, const std::string &what)
{
    return withTexels(withoutTexels(encoded, what), encoded, what);
}

Image readWebp(Encoded, const std::string &what)
{
    throw GltfUnsupported(what + " is a WebP image, which this build cannot decode");
}

Image readAvif(Encoded, const std::string &what)
{
    throw GltfUnsupported(what + " is an AVIF image, which this build cannot decode");
}

} // namespace vellum
