// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/picture.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <png.h>
#include <zlib.h>

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "cli/picture/palette.h"

namespace vellum::cli
{
namespace
{

std::vector<uint8_t> toRgb(const std::vector<uint32_t> &pixels)
{
    std::vector<uint8_t> rgb;
    rgb.reserve(pixels.size() * 3);
    for (const uint32_t pixel : pixels)
        for (unsigned shift = 0; shift < 24; shift += 8)
            rgb.push_back(static_cast<uint8_t>(pixel >> shift));
    return rgb;
}

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

std::vector<uint8_t> encodePng(const Picture &picture, Colors colors)
{
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = picture.width;
    image.height = picture.height;
    image.format = PNG_FORMAT_RGB;
    std::vector<uint8_t> bytesOfPixels;
    std::vector<uint8_t> map;
    if (colors == Colors::Few) {
        Palette palette = makePalette(picture);
        image.format = PNG_FORMAT_RGB_COLORMAP;
        image.colormap_entries = static_cast<png_uint_32>(palette.colors.size());
        map = toRgb(palette.colors);
        bytesOfPixels = std::move(palette.indices);
    } else if (colors == Colors::WithAlpha) {
        image.format = PNG_FORMAT_RGBA;
        bytesOfPixels.resize(4 * picture.pixels.size());
        std::memcpy(bytesOfPixels.data(), picture.pixels.data(), bytesOfPixels.size());
    } else {
        bytesOfPixels = toRgb(picture.pixels);
    }
    std::vector<uint8_t> file(PNG_IMAGE_PNG_SIZE_MAX(image));
    png_alloc_size_t bytes = file.size();
    if (png_image_write_to_memory(&image, file.data(), &bytes, 0, bytesOfPixels.data(), 0, map.data()) == 0)
        throw Error(std::string("the picture cannot be encoded: ") + image.message);
    file.resize(bytes);
    markAsOwn(file);
    return file;
}

Picture sideBySide(const Picture &left, const Picture &right)
{
    Picture both{left.width + right.width, left.height, {}};
    for (size_t row = 0; row < both.height; ++row) {
        for (const Picture *part : {&left, &right}) {
            const auto first = part->pixels.begin() + static_cast<ptrdiff_t>(row * part->width);
            both.pixels.insert(both.pixels.end(), first, first + part->width);
        }
    }
    return both;
}

Difference compare(const Picture &a, const Picture &b)
{
    Difference difference;
    difference.amplified = {a.width, a.height, std::vector<uint32_t>(a.pixels.size(), 0xff000000u)};
    for (size_t i = 0; i < a.pixels.size(); ++i) {
        if (a.pixels[i] == b.pixels[i])
            continue;
        ++difference.pixels;
        uint32_t shown = 0xff000000u;
        for (unsigned shift = 0; shift < 24; shift += 8) {
            const uint32_t x = (a.pixels[i] >> shift) & 255;
            const uint32_t y = (b.pixels[i] >> shift) & 255;
            const uint32_t apart = x > y ? x - y : y - x;
            difference.largest = std::max(difference.largest, apart);
            shown |= std::clamp(8 * apart, 32u, 255u) << shift;
        }
        difference.amplified.pixels[i] = shown;
    }
    return difference;
}

} // namespace vellum::cli
