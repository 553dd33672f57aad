// SPDX-License-Identifier: Apache-2.0
#include "base/picture.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <new>
#ifndef __EMSCRIPTEN__ // which has no zlib: stb_image_write compresses
#include <zlib.h>
#endif

#include "base/error.h"
#include "base/text.h"

#ifdef __EMSCRIPTEN__
namespace
{

// stb_image_write writes past the end of a buffer that could not grow. This leaks its other buffers.
void *reallocated(void *buffer, size_t size)
{
    void *larger = std::realloc(buffer, size);
    if (larger == nullptr)
        throw std::bad_alloc();
    return larger;
}

} // namespace

#define STBIW_MALLOC std::malloc
#define STBIW_REALLOC reallocated
#define STBIW_FREE std::free
#else
namespace
{

// Compression for stb_image_write, whose own is weaker. The caller frees the result by free(); null if memory runs out.
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
#endif
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace vellum
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
    std::array<uint8_t, kPngMark.size()> mark{};
    std::copy(kPngMark.begin(), kPngMark.end(), mark.begin());
    const auto length = word(kPngMark.size() - 4); // without the chunk's type
    const auto sum = word(stbiw__crc32(mark.data(), static_cast<int>(mark.size())));
    std::vector<uint8_t> chunk(length.begin(), length.end());
    chunk.insert(chunk.end(), mark.begin(), mark.end());
    chunk.insert(chunk.end(), sum.begin(), sum.end());
    file.insert(file.begin() + kAfterHeader, chunk.begin(), chunk.end());
}

} // namespace

Picture sideBySide(const Picture &left, const Picture &right)
{
    Picture both{left.width + right.width, left.height, {}};
    for (size_t row = 0; row < both.height; ++row) {
        for (const Picture *part : {&left, &right}) {
            const auto first = part->pixels.begin() + static_cast<ptrdiff_t>(row * part->width);
            both.pixels.insert(both.pixels.end(), first, first + static_cast<ptrdiff_t>(part->width));
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

std::vector<uint8_t> encodePng(const Picture &picture, Alpha alpha)
{
    const int channels = alpha == Alpha::Kept ? 4 : 3;
    // stb_image_write and its compression count bytes in an int; what cannot be compressed takes more.
    constexpr uint64_t kMostBytes = INT_MAX - (1 << 20);
    if ((uint64_t{picture.width} * static_cast<uint64_t>(channels) + 1) * picture.height > kMostBytes)
        throw Error("the picture cannot be encoded: it has too many pixels");
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

std::string pngUri(const Picture &picture, Alpha alpha)
{
    return "data:image/png;base64," + base64Encoded(encodePng(picture, alpha));
}

std::vector<uint8_t> deflated(std::span<const uint8_t> bytes)
{
    constexpr size_t kMostBytes = size_t{1} << 30;
    std::vector<uint8_t> copy(bytes.begin(), bytes.end()); // stb's parameter is not const
    int size = 0;
    const std::unique_ptr<unsigned char, decltype(&std::free)> result(
        copy.size() > kMostBytes ? nullptr : stbi_zlib_compress(copy.data(), static_cast<int>(copy.size()), &size, 6),
        &std::free);
    if (!result)
        throw Error("data cannot be compressed: there is not enough memory");
    return {result.get(), result.get() + size};
}

double textWidth(std::string_view text, uint32_t size)
{
    size_t characters = 0;
    while (!text.empty()) {
        takeCodePoint(text);
        ++characters;
    }
    return 0.58 * size * static_cast<double>(characters);
}

void fillRectangle(Picture &picture, int64_t x, int64_t y, int64_t width, int64_t height, uint32_t color)
{
    for (int64_t row = std::max<int64_t>(y, 0); row < std::min<int64_t>(y + height, picture.height); ++row)
        for (int64_t column = std::max<int64_t>(x, 0); column < std::min<int64_t>(x + width, picture.width); ++column)
            picture.pixels[static_cast<size_t>(row) * picture.width + static_cast<size_t>(column)] = color;
}

double roundStep(double step)
{
    const double power = std::pow(10, std::floor(std::log10(step)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= step)
            return factor * power;
    return 10 * power;
}

std::string fitText(std::string_view text, uint32_t size, double width)
{
    const auto most = static_cast<size_t>(std::max(width / (0.58 * size), 0.0));
    std::string_view rest = text;
    size_t fitting = 0; // bytes that fit together with the dots
    for (size_t characters = 1; !rest.empty(); ++characters) {
        takeCodePoint(rest);
        if (characters > most)
            return std::string(text.substr(0, fitting)) + "...";
        if (characters + 3 <= most)
            fitting = text.size() - rest.size();
    }
    return std::string(text);
}

std::string encodeSvg(const LabelledPicture &labelled)
{
    const Picture &picture = labelled.picture;
    const std::string size =
        "width=\"" + std::to_string(picture.width) + "\" height=\"" + std::to_string(picture.height) + "\"";
    std::string svg = std::string(kSvgMark) + "\n<svg xmlns=\"http://www.w3.org/2000/svg\" " + size +
                      " font-family=\"sans-serif\">\n<image " + size + " href=\"" + pngUri(picture) + "\"/>\n";
    for (const Label &label : labelled.labels) {
        char attributes[160];
        constexpr std::array kAnchors = {"start", "middle", "end"};
        std::snprintf(attributes, sizeof attributes,
                      "x=\"%.0f\" y=\"%.0f\" font-size=\"%u\" fill=\"#%06x\" text-anchor=\"%s\"%s", label.x, label.y,
                      label.size, label.color, kAnchors[static_cast<size_t>(label.anchor)],
                      label.bold ? " font-weight=\"bold\"" : "");
        svg += std::string("<text ") + attributes + ">" + markupText(label.text) + "</text>\n";
    }
    return svg + "</svg>\n";
}

} // namespace vellum
