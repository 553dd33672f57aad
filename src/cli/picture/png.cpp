// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/png.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <zlib.h>

#include "cli/base/error.h"
#include "cli/base/output_file.h"

namespace
{

// For stb_image_write, whose own compression is weaker. The result is freed by free(); null if there is no memory.
unsigned char *compressed(const unsigned char *data, int bytes, int *resultBytes, int quality)
{
    uLongf size = compressBound(static_cast<uLong>(bytes));
    auto *result = static_cast<unsigned char *>(std::malloc(size));
    if (result == nullptr || compress2(result, &size, data, static_cast<uLong>(bytes), quality) != Z_OK) {
        std::free(result);
        return nullptr;
    }
    *resultBytes = static_cast<int>(size);
    return result;
}

} // namespace

#define STBIW_ZLIB_COMPRESS compressed
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace vellum::cli
{
namespace
{

// Inserts a tEXt chunk after the header (IHDR).
void markAsOwn(std::vector<uint8_t> &file)
{
    constexpr size_t kAfterHeader = 8 + 25;
    const auto word = [](uint64_t value) {
        return std::array{static_cast<uint8_t>(value >> 24), static_cast<uint8_t>(value >> 16),
                          static_cast<uint8_t>(value >> 8), static_cast<uint8_t>(value)};
    };
    const auto *mark = reinterpret_cast<const uint8_t *>(kPngMark.data());
    const auto length = word(kPngMark.size() - 4); // without the chunk's type
    const auto sum = word(crc32(0, mark, static_cast<uInt>(kPngMark.size())));
    std::vector<uint8_t> chunk(length.begin(), length.end());
    chunk.insert(chunk.end(), mark, mark + kPngMark.size());
    chunk.insert(chunk.end(), sum.begin(), sum.end());
    file.insert(file.begin() + kAfterHeader, chunk.begin(), chunk.end());
}

} // namespace

std::vector<uint8_t> encodePng(const Picture &picture, Alpha alpha)
{
    const int channels = alpha == Alpha::Kept ? 4 : 3;
    std::vector<uint8_t> bytes;
    bytes.reserve(picture.pixels.size() * static_cast<size_t>(channels));
    for (const uint32_t pixel : picture.pixels)
        for (int channel = 0; channel < channels; ++channel)
            bytes.push_back(static_cast<uint8_t>(pixel >> (8 * channel)));
    int size = 0;
    const auto width = static_cast<int>(picture.width);
    const std::unique_ptr<unsigned char, decltype(&std::free)> encoded(
        stbi_write_png_to_mem(bytes.data(), width * channels, width, static_cast<int>(picture.height), channels, &size),
        &std::free);
    if (!encoded)
        throw Error("the picture cannot be encoded: there is not enough memory");
    std::vector<uint8_t> file(encoded.get(), encoded.get() + size);
    markAsOwn(file);
    return file;
}

} // namespace vellum::cli
