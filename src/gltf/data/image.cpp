// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <string_view>

#include "gltf/data/image_formats.h"

namespace vellum
{
namespace
{

using namespace std::string_view_literals;

constexpr uint64_t kTexelsAlwaysAllowed = uint64_t{1} << 24;

// What helps where the texels cannot be had.
constexpr const char *kBakeEarlier =
    ", which is not supported: bake before the textures are compressed, by a tool that "
    "keeps unknown extensions, or keep their PNG or JPEG images";

bool has(Encoded encoded, size_t offset, std::string_view bytes)
{
    return encoded.size() >= offset + bytes.size() &&
           std::memcmp(encoded.data() + offset, bytes.data(), bytes.size()) == 0;
}

// Checks those parts of a JPEG's headers that decoders do not distinguish, or trust.
void checkJpeg(Encoded encoded, const std::string &what)
{
    constexpr size_t kMostScans = 128; // each of them may go over the whole image
    size_t scans = 0;
    for (size_t i = 2; i + 9 < encoded.size(); ++i) {
        if (encoded[i] != 0xff)
            continue;
        const uint8_t marker = encoded[i + 1];
        const bool frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (frame && scans == 0) {
            const bool known = marker <= 0xc2 || marker == 0xc9 || marker == 0xca;
            if (!known || encoded[i + 4] != 8)
                throw GltfUnsupported(what +
                                      " is a JPEG of a kind that is not supported: lossless, hierarchical, or of "
                                      "12 bits");
            const unsigned components = encoded[i + 9];
            if (components != 1 && components != 3)
                throw GltfUnsupported(what + " is a JPEG of " + std::to_string(components) + " components");
        }
        if (marker == 0xda && ++scans > kMostScans)
            failToDecode(what, "it has too many scans");
        if (scans == 0 && marker != 0xff && marker != 0)
            i += 1u + (size_t{encoded[i + 2]} << 8 | encoded[i + 3]); // to the next marker
    }
}

} // namespace

uint64_t mostTexels(Encoded encoded)
{
    return std::max(kTexelsAlwaysAllowed, kMostTexelsPerByte * encoded.size());
}

Image imageOf(uint64_t width, uint64_t height, Encoded encoded, const std::string &what)
{
    const std::string size = std::to_string(width) + " x " + std::to_string(height) + " texels";
    if (width == 0 || height == 0 || width > kMostTexels || height > kMostTexels)
        throw GltfError(what + " has " + size);
    if (width * height > mostTexels(encoded))
        throw GltfError(what + " has " + size + " in " + std::to_string(encoded.size()) + " bytes");
    return {static_cast<uint32_t>(width), static_cast<uint32_t>(height), {}, {}};
}

void checkDeflated(uint64_t bytes, Encoded encoded, const std::string &what)
{
    if (bytes > uint64_t{1032} * encoded.size())
        failToDecode(what, "it is cut off");
}

void takeWide(Encoded rows, Image &image)
{
    image.rgba.resize(rows.size() / 2);
    image.alpha16.resize(rows.size() / 8);
    for (size_t i = 0; i < image.rgba.size(); ++i)
        image.rgba[i] = rows[2 * i];
    for (size_t i = 0; i < image.alpha16.size(); ++i)
        image.alpha16[i] = static_cast<uint16_t>(rows[8 * i + 6] << 8 | rows[8 * i + 7]);
}

bool isAvif(Encoded encoded)
{
    if (!has(encoded, 4, "ftyp"sv))
        return false;
    // The size of the box, "ftyp", the major brand, a version, compatible brands.
    const size_t size = size_t{encoded[0]} << 24 | size_t{encoded[1]} << 16 | size_t{encoded[2]} << 8 | encoded[3];
    for (size_t at = 8; at + 4 <= std::min(size, encoded.size()); at += at == 8 ? 8 : 4)
        if (has(encoded, at, "avif"sv) || has(encoded, at, "avis"sv))
            return true;
    return false;
}

Image decodeImage(Encoded encoded, const std::string &what)
{
    if (encoded.empty())
        throw GltfError(what + " is empty");
    if (has(encoded, 0, "\x89PNG\r\n\x1a\n"sv))
        return readPng(encoded, what);
    if (has(encoded, 0, "\xff\xd8\xff"sv)) {
        checkJpeg(encoded, what);
        return readJpeg(encoded, what);
    }
    if (has(encoded, 0, "RIFF"sv) && has(encoded, 8, "WEBP"sv))
        return readWebp(encoded, what);
    if (isAvif(encoded))
        return readAvif(encoded, what);
    if (has(encoded, 0, "\xabKTX 20\xbb\r\n\x1a\n"sv))
        throw GltfUnsupported(what + " is a KTX2 file" + kBakeEarlier);
    if (has(encoded, 0, "DDS "sv))
        throw GltfUnsupported(what + " is a DDS file" + kBakeEarlier);
    failToDecode(what, "it is neither PNG nor JPEG nor WebP nor AVIF");
}

} // namespace vellum
