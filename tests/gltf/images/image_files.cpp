// SPDX-License-Identifier: Apache-2.0
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <zlib.h>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb_image_write.h>

#include "compressed.h"

namespace vellum::test
{
namespace
{

void appendWord(Bytes &bytes, uint32_t word)
{
    for (const int shift : {24, 16, 8, 0})
        bytes.push_back(static_cast<uint8_t>(word >> shift));
}

void appendChunk(Bytes &file, const std::string &type, const Bytes &data)
{
    appendWord(file, static_cast<uint32_t>(data.size()));
    const size_t checked = file.size();
    file.insert(file.end(), type.begin(), type.end());
    file.insert(file.end(), data.begin(), data.end());
    appendWord(file, static_cast<uint32_t>(crc32(0, file.data() + checked, static_cast<uInt>(file.size() - checked))));
}

Bytes deflated(const Bytes &bytes)
{
    uLongf size = compressBound(static_cast<uLong>(bytes.size()));
    Bytes compressed(size);
    if (compress(compressed.data(), &size, bytes.data(), static_cast<uLong>(bytes.size())) != Z_OK)
        throw std::runtime_error("zlib cannot compress the test's image");
    compressed.resize(size);
    return compressed;
}

// One pass of an image. Each row begins with filter 0 and has the pixels at these columns.
struct Pass {
    uint32_t firstColumn, firstRow, columns, rows; // and the distances to the next
};
constexpr Pass kWhole[] = {{0, 0, 1, 1}};
constexpr Pass kInterlaced[] = {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};

void appendPass(Bytes &data, const Pass &pass, uint32_t width, uint32_t height, uint32_t bits, const Bytes &rows)
{
    const size_t stride = rows.size() / height;
    for (uint32_t y = pass.firstRow; y < height && pass.firstColumn < width; y += pass.rows) {
        data.push_back(0);
        const size_t begin = data.size();
        const uint32_t pixels = (width - pass.firstColumn + pass.columns - 1) / pass.columns;
        data.resize(begin + (size_t{pixels} * bits + 7) / 8);
        size_t bit = 0;
        for (uint32_t x = pass.firstColumn; x < width; x += pass.columns)
            for (size_t from = size_t{x} * bits; from < size_t{x + 1} * bits; ++from, ++bit)
                if ((rows[y * stride + from / 8] >> (7 - from % 8) & 1) != 0)
                    data[begin + bit / 8] = static_cast<uint8_t>(data[begin + bit / 8] | 0x80 >> bit % 8);
    }
}

} // namespace

Bytes resizedAvif(Bytes avif, uint32_t width, uint32_t height)
{
    for (size_t i = 0; i + 16 < avif.size(); ++i)
        if (std::string_view(reinterpret_cast<const char *>(&avif[i]), 4) == "ispe")
            for (size_t byte = 0; byte < 4; ++byte) { // after the version and flags
                avif[i + 8 + byte] = static_cast<uint8_t>(width >> (24 - 8 * byte));
                avif[i + 12 + byte] = static_cast<uint8_t>(height >> (24 - 8 * byte));
            }
    return avif;
}

Bytes jpegImage(uint32_t width, uint32_t height, const Bytes &rgb)
{
    Bytes bytes;
    const auto append = [](void *context, void *data, int size) {
        const auto *first = static_cast<const uint8_t *>(data);
        static_cast<Bytes *>(context)->insert(static_cast<Bytes *>(context)->end(), first, first + size);
    };
    stbi_write_jpg_to_func(append, &bytes, static_cast<int>(width), static_cast<int>(height), 3, rgb.data(), 95);
    return bytes;
}

Bytes pngImage(uint32_t width, uint32_t height, int bitDepth, int colorType, bool interlaced, const Bytes &rows)
{
    Bytes header;
    appendWord(header, width);
    appendWord(header, height);
    header.insert(header.end(), {static_cast<uint8_t>(bitDepth), static_cast<uint8_t>(colorType), 0, 0, interlaced});
    const int channels = colorType == kRgba ? 4 : colorType == kRgb ? 3 : colorType == kGrayAlpha ? 2 : 1;
    Bytes data;
    for (const Pass &pass : interlaced ? std::span<const Pass>(kInterlaced) : kWhole)
        appendPass(data, pass, width, height, static_cast<uint32_t>(bitDepth * channels), rows);
    Bytes file = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    appendChunk(file, "IHDR", header);
    appendChunk(file, "IDAT", deflated(data));
    appendChunk(file, "IEND", {});
    return file;
}

} // namespace vellum::test
