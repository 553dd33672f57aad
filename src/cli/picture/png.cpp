// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/png.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>
#include <zlib.h>

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "cli/picture/palette.h"

namespace vellum::cli
{
namespace
{

using Bytes = std::vector<uint8_t>;

// The fields of IHDR, the image header, that differ.
enum class ColorType : uint8_t { Rgb = 2, Indexed = 3, Rgba = 6 };

void appendWord(Bytes &bytes, uint64_t value)
{
    for (unsigned shift = 32; shift > 0; shift -= 8)
        bytes.push_back(static_cast<uint8_t>(value >> (shift - 8)));
}

void appendChunk(Bytes &file, std::string_view type, std::span<const uint8_t> data)
{
    appendWord(file, data.size());
    const size_t begin = file.size();
    file.insert(file.end(), type.begin(), type.end());
    file.insert(file.end(), data.begin(), data.end());
    appendWord(file, crc32(0, file.data() + begin, static_cast<uInt>(file.size() - begin)));
}

Bytes channelsOf(const std::vector<uint32_t> &pixels, unsigned channels)
{
    Bytes bytes;
    bytes.reserve(pixels.size() * channels);
    for (const uint32_t pixel : pixels)
        for (unsigned shift = 0; shift < 8 * channels; shift += 8)
            bytes.push_back(static_cast<uint8_t>(pixel >> shift));
    return bytes;
}

int paeth(int left, int above, int aboveLeft)
{
    const int estimate = left + above - aboveLeft;
    const int a = std::abs(estimate - left), b = std::abs(estimate - above), c = std::abs(estimate - aboveLeft);
    return a <= b && a <= c ? left : b <= c ? above : aboveLeft;
}

// What a filter of PNG expects of a byte, from those before it.
int expected(unsigned filter, int left, int above, int aboveLeft)
{
    switch (filter) {
    case 1: return left;
    case 2: return above;
    case 3: return (left + above) / 2;
    case 4: return paeth(left, above, aboveLeft);
    default: return 0;
    }
}

// Rows with a filter each: that with the least sum of differences, as the specification of PNG advises.
Bytes filteredRows(const Bytes &bytes, size_t rowBytes, size_t pixelBytes)
{
    Bytes rows;
    rows.reserve(bytes.size() + bytes.size() / rowBytes);
    const Bytes nothing(rowBytes, 0);
    Bytes row(rowBytes), best;
    for (size_t at = 0; at < bytes.size(); at += rowBytes) {
        const uint8_t *now = bytes.data() + at;
        const uint8_t *above = at == 0 ? nothing.data() : now - rowBytes;
        uint64_t least = UINT64_MAX;
        uint8_t chosen = 0;
        for (uint8_t filter = 0; filter < 5; ++filter) {
            uint64_t sum = 0;
            for (size_t i = 0; i < rowBytes; ++i) {
                const bool first = i < pixelBytes;
                const int guess =
                    expected(filter, first ? 0 : now[i - pixelBytes], above[i], first ? 0 : above[i - pixelBytes]);
                row[i] = static_cast<uint8_t>(now[i] - guess);
                sum += static_cast<uint64_t>(std::abs(static_cast<int8_t>(row[i])));
            }
            if (sum < least) {
                least = sum;
                chosen = filter;
                best.swap(row);
                row.resize(rowBytes);
            }
        }
        rows.push_back(chosen);
        rows.insert(rows.end(), best.begin(), best.end());
    }
    return rows;
}

// Rows of indices with `bits` each, unfiltered.
Bytes packedRows(const Bytes &indices, size_t width, unsigned bits)
{
    Bytes rows;
    for (size_t at = 0; at < indices.size(); at += width) {
        rows.push_back(0);
        for (size_t x = 0; x < width; ++x) {
            const size_t bit = x * bits % 8;
            if (bit == 0)
                rows.push_back(0);
            rows.back() = static_cast<uint8_t>(rows.back() | indices[at + x] << (8 - bits - bit));
        }
    }
    return rows;
}

Bytes deflated(const Bytes &rows, int strategy)
{
    z_stream stream{};
    if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS, 9, strategy) != Z_OK)
        throw Error("the picture cannot be compressed");
    Bytes result(deflateBound(&stream, static_cast<uLong>(rows.size())));
    stream.next_in = const_cast<Bytef *>(rows.data());
    stream.avail_in = static_cast<uInt>(rows.size());
    stream.next_out = result.data();
    stream.avail_out = static_cast<uInt>(result.size());
    const int end = deflate(&stream, Z_FINISH);
    result.resize(result.size() - stream.avail_out);
    deflateEnd(&stream);
    if (end != Z_STREAM_END)
        throw Error("the picture cannot be compressed");
    return result;
}

Bytes fileOf(const Picture &picture, ColorType type, unsigned bits, const Bytes &palette, const Bytes &data)
{
    constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";
    Bytes file(kSignature.begin(), kSignature.end());
    Bytes header;
    appendWord(header, picture.width);
    appendWord(header, picture.height);
    for (const unsigned field : {bits, static_cast<unsigned>(type), 0u, 0u, 0u})
        header.push_back(static_cast<uint8_t>(field));
    appendChunk(file, "IHDR", header);
    constexpr size_t kTypeBytes = 4;
    appendChunk(file, kPngMark.substr(0, kTypeBytes),
                {reinterpret_cast<const uint8_t *>(kPngMark.data()) + kTypeBytes, kPngMark.size() - kTypeBytes});
    appendChunk(file, "sRGB", std::array<uint8_t, 1>{0});
    if (!palette.empty())
        appendChunk(file, "PLTE", palette);
    appendChunk(file, "IDAT", data);
    appendChunk(file, "IEND", {});
    return file;
}

} // namespace

std::vector<uint8_t> encodePng(const Picture &picture, Colors colors)
{
    if (colors == Colors::Few) {
        const Palette palette = makePalette(picture);
        const size_t count = palette.colors.size();
        const unsigned bits = count > 16 ? 8 : count > 4 ? 4 : count > 2 ? 2 : 1;
        return fileOf(picture, ColorType::Indexed, bits, channelsOf(palette.colors, 3),
                      deflated(packedRows(palette.indices, picture.width, bits), Z_DEFAULT_STRATEGY));
    }
    const unsigned channels = colors == Colors::WithAlpha ? 4 : 3;
    const Bytes rows = filteredRows(channelsOf(picture.pixels, channels), picture.width * channels, channels);
    return fileOf(picture, channels == 4 ? ColorType::Rgba : ColorType::Rgb, 8, {}, deflated(rows, Z_FILTERED));
}

} // namespace vellum::cli
