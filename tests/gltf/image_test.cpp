// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/image.h"

#include <cmath>
#include <cstdlib>
#include <gtest/gtest.h>

#include "compressed.h"
#include "gltf/file/gltf_error.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

std::string decodingError(const Bytes &encoded)
{
    try {
        static_cast<void>(decodeImage(encoded, "image 0"));
    } catch (const GltfUnsupported &error) {
        return std::string("unsupported: ") + error.what();
    } catch (const GltfError &error) {
        return error.what();
    }
    return "none";
}

} // namespace

TEST(GltfImage, PngOfEveryKind)
{
    using Texels = std::vector<uint8_t>;
    for (const bool interlaced : {false, true}) {
        const auto read = [&](int bits, int type, const Bytes &rows, uint32_t width) {
            const Image image = decodeImage(pngImage(width, 1, bits, type, interlaced, rows), "image 0");
            EXPECT_EQ(image.width, width);
            EXPECT_EQ(image.height, 1u);
            return image.rgba;
        };
        EXPECT_EQ(read(8, kRgba, {1, 2, 3, 4, 5, 6, 7, 8}, 2), (Texels{1, 2, 3, 4, 5, 6, 7, 8}));
        EXPECT_EQ(read(8, kRgb, {1, 2, 3, 4, 5, 6}, 2), (Texels{1, 2, 3, 255, 4, 5, 6, 255}));
        EXPECT_EQ(read(8, kGray, {1, 2}, 2), (Texels{1, 1, 1, 255, 2, 2, 2, 255}));
        EXPECT_EQ(read(1, kGray, {0x40}, 2), (Texels{0, 0, 0, 255, 255, 255, 255, 255}));
        EXPECT_EQ(read(8, kGrayAlpha, {1, 2}, 1), (Texels{1, 1, 1, 2}));
        EXPECT_EQ(read(16, kRgba, {1, 255, 2, 255, 3, 255, 4, 255}, 1), (Texels{1, 2, 3, 4}));
        EXPECT_EQ(read(16, kGrayAlpha, {1, 255, 2, 255}, 1), (Texels{1, 1, 1, 2}));
    }
}

TEST(GltfImage, Webp)
{
    const Bytes rgba = {255, 0, 0, 128, 0, 255, 0, 7};
    const Bytes encoded = webpImage(2, 1, rgba);
    if (kDecodesWebpAndAvif)
        EXPECT_EQ(decodeImage(encoded, "image 0").rgba, rgba);
    else
        EXPECT_EQ(decodingError(encoded), "unsupported: image 0 is a WebP image, which this build cannot decode");
}

// Every alpha that there is, as it is stored, with colours.
TEST(GltfImage, AvifOfEveryDepth)
{
    if (!kDecodesWebpAndAvif) {
        EXPECT_EQ(decodingError(avifImage(2, 1, {})),
                  "unsupported: image 0 is an AVIF image, which this build cannot decode");
        return;
    }
    for (const unsigned depth : {8u, 10u, 12u})
        for (const unsigned columns : {1u, 4u}) {
            const unsigned largest = (1u << depth) - 1;
            const uint32_t size = 64;
            std::vector<uint16_t> rgba;
            for (unsigned i = 0; i < size * size; ++i)
                for (const unsigned value : {3 * i, i / 5, 7u, i})
                    rgba.push_back(static_cast<uint16_t>(value % (largest + 1)));
            const Image image =
                decodeImage(avifImage(size, size, rgba, {.depth = depth, .columns = columns}), "image 0");
            ASSERT_EQ(image.width, size * columns);
            ASSERT_EQ(image.height, size);
            ASSERT_EQ(image.rgba.size(), size_t{4} * image.width * image.height);
            ASSERT_EQ(image.alpha16.size(), depth > 8 ? size_t{image.width} * image.height : 0);
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                const size_t from = i / 4 / image.width * size + i / 4 % size; // cells are equal
                const uint16_t value = rgba[4 * from + i % 4];
                ASSERT_EQ(image.rgba[i], std::lround(value * 255.0 / largest)) << depth << ' ' << i;
                if (i % 4 == 3 && depth > 8) {
                    ASSERT_EQ(image.alpha16[i / 4], std::lround(value * 65535.0 / largest));
                }
            }
        }
}

TEST(GltfImage, AvifAlphaIsStoredApartFromColours)
{
    if (!kDecodesWebpAndAvif)
        GTEST_SKIP() << "this build has no libavif";
    std::vector<uint16_t> rgba;
    std::vector<uint16_t> premultiplied;
    for (unsigned i = 0; i < 64 * 64; ++i) {
        const auto alpha = static_cast<uint16_t>(i % 256);
        rgba.insert(rgba.end(), {255, 255, 255, alpha});
        premultiplied.insert(premultiplied.end(), {alpha, alpha, alpha, alpha});
    }
    EXPECT_EQ(decodeImage(avifImage(64, 64, premultiplied, {.premultiplied = true}), "image 0").rgba[4 * 77], 255);
    for (const bool multiplied : {false, true}) {
        const Bytes file = avifImage(64, 64, multiplied ? premultiplied : rgba, {.premultiplied = multiplied});
        const Image image = decodeImage(file, "image 0");
        for (size_t i = 0; i < 64 * 64; ++i)
            ASSERT_EQ(image.rgba[4 * i + 3], i % 256);
    }
    for (const unsigned depth : {8u, 12u}) {
        const Image image = decodeImage(avifImage(64, 64, rgba, {.depth = depth, .alpha = false}), "image 0");
        EXPECT_TRUE(image.alpha16.empty());
        for (size_t i = 0; i < 64 * 64; ++i)
            ASSERT_EQ(image.rgba[4 * i + 3], 255);
    }
}

TEST(GltfImage, AvifThatIsNoStillImage)
{
    if (!kDecodesWebpAndAvif)
        GTEST_SKIP() << "this build has no libavif";
    const std::vector<uint16_t> rgba(size_t{4} * 64 * 64, 99);
    const std::string transformed =
        "unsupported: image 0 is to be rotated, mirrored or cropped (irot, imir, clap), which "
        "some renderers do and others do not";
    EXPECT_EQ(decodingError(avifImage(64, 64, rgba, {.rotation = 0})), "none");
    EXPECT_EQ(decodingError(avifImage(64, 64, rgba, {.rotation = 1})), transformed);
    EXPECT_EQ(decodingError(avifImage(64, 64, rgba, {.mirrored = true})), transformed);
    EXPECT_EQ(decodingError(avifImage(64, 64, rgba, {.cropped = true})), transformed);
    EXPECT_EQ(decodingError(avifImage(64, 64, rgba, {.frames = 2})), "unsupported: image 0 is an animation");
}

namespace
{

// A box of an ISO media file.
Bytes box(const std::string &type, const Bytes &contents)
{
    const size_t size = 8 + contents.size();
    Bytes bytes;
    for (const int shift : {24, 16, 8, 0})
        bytes.push_back(static_cast<uint8_t>(size >> shift));
    bytes.insert(bytes.end(), type.begin(), type.end());
    bytes.insert(bytes.end(), contents.begin(), contents.end());
    return bytes;
}

Bytes joined(const std::vector<Bytes> &parts)
{
    Bytes bytes;
    for (const Bytes &part : parts)
        bytes.insert(bytes.end(), part.begin(), part.end());
    return bytes;
}

Bytes repeated(const Bytes &part, size_t count)
{
    return joined(std::vector<Bytes>(count, part));
}

// An AVIF file with the items of that "iloc", whose data is stored in the file's box of metadata.
Bytes avifOf(const Bytes &items, const Bytes &data, const Bytes &otherTables = {})
{
    const Bytes brands = {'a', 'v', 'i', 'f', 0, 0, 0, 0, 'm', 'i', 'f', '1'};
    const Bytes meta = joined({Bytes(4), box("iloc", items), box("idat", data), otherTables});
    return joined({box("ftyp", brands), box("meta", meta)});
}

// An "iloc" of version 1: offsets and lengths of 4 bytes, one item, extents that all have that range of "idat".
Bytes itemOf(uint16_t extents, uint32_t offset, uint32_t length)
{
    Bytes item = {
        1, 0, 0, 0, 0x44, 0, 0, 1, 0, 1, 0, 1, 0, 0, static_cast<uint8_t>(extents >> 8), static_cast<uint8_t>(extents)};
    Bytes extent;
    for (const uint32_t number : {offset, length})
        for (const int shift : {24, 16, 8, 0})
            extent.push_back(static_cast<uint8_t>(number >> shift));
    return joined({item, repeated(extent, extents)});
}

} // namespace

// Small files that would make libavif decode many frames, or keep many parts. Those at the limit fail for what they
// lack.
TEST(GltfImage, AvifOfManyParts)
{
    if (!kDecodesWebpAndAvif)
        GTEST_SKIP() << "this build has no libavif";
    const std::string many = "image 0 cannot be decoded: it has too many parts";
    const auto isMany = [&](const Bytes &file) {
        const std::string error = decodingError(file);
        EXPECT_TRUE(error.starts_with("image 0 cannot be decoded: ")) << error;
        return error == many;
    };
    const Bytes frame = {0x32, 0};
    const Bytes extended = {0x1e, 0, 0}; // a frame's header
    const Bytes padding = {0x7a, 0x80, 0};
    for (const Bytes &unit : {frame, extended}) {
        const auto size = static_cast<uint32_t>(128 * unit.size());
        EXPECT_FALSE(isMany(avifOf(itemOf(1, 0, size), repeated(unit, 129))));
        EXPECT_TRUE(isMany(avifOf(itemOf(1, 0, size + 1), repeated(unit, 129))));
        EXPECT_TRUE(isMany(avifOf(itemOf(1, 0, 0xffffffff), repeated(unit, 129))));
    }
    EXPECT_FALSE(isMany(avifOf(itemOf(128, 0, 2), repeated(frame, 1000)))); // extents that are joined
    EXPECT_TRUE(isMany(avifOf(itemOf(129, 0, 2), repeated(frame, 1000))));
    EXPECT_FALSE(isMany(avifOf(itemOf(1, 0, 3 * 60000), repeated(padding, 70000))));
    EXPECT_TRUE(isMany(avifOf(itemOf(1, 0, 3 * 70000), repeated(padding, 70000))));
    EXPECT_EQ(decodingError(avifOf(itemOf(100, 0, 1000), Bytes(2000))), "image 0 cannot be decoded: its parts overlap");
    // Extents of 0 bytes that take none in the table, either.
    EXPECT_FALSE(isMany(avifOf({1, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 1, 0, 0, 0xff, 0xff}, {})));
    EXPECT_TRUE(
        isMany(avifOf({1, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 1, 0, 0, 0xff, 0xff, 0, 2, 0, 1, 0, 0, 0xff, 0xff}, {})));
    EXPECT_FALSE(isMany(avifOf(itemOf(0, 0, 0), {}, box("iref", Bytes(60000)))));
    EXPECT_TRUE(isMany(avifOf(itemOf(0, 0, 0), {}, box("iref", Bytes(66000)))));
    EXPECT_TRUE(isMany(avifOf(itemOf(0, 0, 0), {}, box("iprp", box("ipma", Bytes(66000))))));
    EXPECT_FALSE(isMany(avifOf(itemOf(0, 0, 0), {}, box("iprp", box("ipco", Bytes(66000)))))); // a colour profile
}

TEST(GltfImage, Jpeg)
{
    const Image jpeg = decodeImage(jpegImage(2, 1, {100, 100, 100, 100, 100, 100}), "image 0");
    ASSERT_EQ(jpeg.rgba.size(), 8u);
    for (const size_t i : {0u, 1u, 2u, 4u})
        EXPECT_NEAR(jpeg.rgba[i], 100, 3);
    EXPECT_EQ(jpeg.rgba[3], 255);
}

TEST(GltfImage, UnsupportedKindsAreIdentified)
{
    const auto padded = [](std::string text) {
        text.resize(64);
        return Bytes(text.begin(), text.end());
    };
    const std::string help = ", which is not supported: bake before the textures are compressed, by a tool that keeps "
                             "unknown extensions, or keep their PNG or JPEG images";
    EXPECT_EQ(decodingError(padded("\xabKTX 20\xbb\r\n\x1a\n")), "unsupported: image 0 is a KTX2 file" + help);
    EXPECT_EQ(decodingError(padded("DDS ")), "unsupported: image 0 is a DDS file" + help);
    // Other ISO media files.
    for (const char *brand : {"heic", "isom", "mif1", "avic"})
        EXPECT_EQ(decodingError(padded(std::string("\0\0\0\x20", 4) + "ftyp" + brand)),
                  "image 0 cannot be decoded: it is neither PNG nor JPEG nor WebP nor AVIF");
    Bytes jpeg = jpegImage(8, 8, Bytes(192));
    for (size_t i = 0; i + 1 < jpeg.size(); ++i)
        if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
            Bytes lossless = jpeg;
            lossless[i + 1] = 0xc3;
            EXPECT_EQ(decodingError(lossless).substr(0, 40), "unsupported: image 0 is a JPEG of a kind");
            jpeg[i + 4] = 12;
            EXPECT_EQ(decodingError(jpeg).substr(0, 40), "unsupported: image 0 is a JPEG of a kind");
            return;
        }
    FAIL() << "the JPEG has no frame";
}

// Whatever is cut off or changed is an error or an image, and those that need all their bytes are an error.
TEST(GltfImage, DamagedImages)
{
    const Bytes rgba(64 * 64 * 4, 77);
    std::vector<Bytes> whole = {pngImage(64, 64, 8, kRgba, false, rgba), jpegImage(64, 64, rgba)};
    if (kDecodesWebpAndAvif) {
        whole.push_back(webpImage(64, 64, rgba));
        for (const unsigned depth : {8u, 10u, 12u})
            whole.push_back(avifImage(64, 64, {rgba.begin(), rgba.end()}, {.depth = depth}));
        whole.push_back(avifImage(64, 64, {rgba.begin(), rgba.end()}, {.columns = 2}));
    }
    for (const Bytes &image : whole) {
        EXPECT_EQ(decodingError(image), "none");
        for (size_t length = 0; length + 12 < image.size(); ++length) {
            const std::string error =
                decodingError(Bytes(image.begin(), image.begin() + static_cast<ptrdiff_t>(length)));
            if (image[0] != 0xff || length < 20) {
                EXPECT_NE(error, "none") << length << " of " << image.size() << " bytes";
            }
        }
    }
}

TEST(GltfImage, SmallFilesAreNoHugeImages)
{
    Bytes png = pngImage(64, 64, 8, kRgba, false, Bytes(64 * 64 * 4));
    // The header's checksum is wrong then, which is noticed first: a size that libpng rejects, or the checksum.
    png[18] = 0x40;
    EXPECT_NE(decodingError(png), "none");
    if (!kDecodesWebpAndAvif)
        return;
    // Sizes that are believed, of one colour.
    const Bytes webp = webpImage(16383, 1025, Bytes(size_t{16383} * 1025 * 4));
    EXPECT_LT(webp.size(), 4096u);
    EXPECT_EQ(decodingError(webp), "image 0 has 16383 x 1025 texels in " + std::to_string(webp.size()) + " bytes");
    const Bytes avif = avifImage(64, 64, std::vector<uint16_t>(size_t{4} * 64 * 64));
    const auto resized = [](const Bytes &file, uint32_t width, uint32_t height) {
        return decodingError(resizedAvif(file, width, height));
    };
    EXPECT_EQ(resized(avif, 64, 64), "none");
    EXPECT_EQ(resized(avif, 16384, 1025),
              "image 0 has 16384 x 1025 texels in " + std::to_string(avif.size()) + " bytes");
    EXPECT_EQ(resized(avif, 16385, 1), "image 0 has 16385 x 1 texels");
    EXPECT_EQ(resized(avif, 100000, 64), "image 0 has 100000 x 64 texels");
    EXPECT_NE(resized(avif, 0, 64), "none");
    EXPECT_NE(resized(avif, 0xffffffff, 0xffffffff), "none");
}
