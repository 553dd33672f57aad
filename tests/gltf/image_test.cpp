// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/image.h"

#include <cstdlib>
#include <gtest/gtest.h>

#include "compressed.h"
#include "gltf/file/gltf_error.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

std::string errorOf(const Bytes &encoded)
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
    if (kDecodesWebp)
        EXPECT_EQ(decodeImage(encoded, "image 0").rgba, rgba);
    else
        EXPECT_EQ(errorOf(encoded), "unsupported: image 0 is a WebP image, which this build cannot decode "
                                    "(VELLUM_IMAGE_LIBRARIES)");
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
    EXPECT_EQ(errorOf(padded("\xabKTX 20\xbb\r\n\x1a\n")),
              "unsupported: image 0 is a KTX2 file, which is not supported");
    EXPECT_EQ(errorOf(padded(std::string("\0\0\0\x20", 4) + "ftypavif")),
              "unsupported: image 0 is an AVIF file, which is not supported");
    EXPECT_EQ(errorOf(padded("DDS ")), "unsupported: image 0 is a DDS file, which is not supported");
    Bytes jpeg = jpegImage(8, 8, Bytes(192));
    for (size_t i = 0; i + 1 < jpeg.size(); ++i)
        if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
            Bytes lossless = jpeg;
            lossless[i + 1] = 0xc3;
            EXPECT_EQ(errorOf(lossless).substr(0, 40), "unsupported: image 0 is a JPEG of a kind");
            jpeg[i + 4] = 12;
            EXPECT_EQ(errorOf(jpeg).substr(0, 40), "unsupported: image 0 is a JPEG of a kind");
            return;
        }
    FAIL() << "the JPEG has no frame";
}

// Whatever is cut off or changed is an error or an image, and those that need all their bytes are an error.
TEST(GltfImage, DamagedImages)
{
    const Bytes rgba(64 * 64 * 4, 77);
    std::vector<Bytes> whole = {pngImage(64, 64, 8, kRgba, false, rgba), jpegImage(64, 64, rgba)};
    if (kDecodesWebp)
        whole.push_back(webpImage(64, 64, rgba));
    for (const Bytes &image : whole) {
        EXPECT_EQ(errorOf(image), "none");
        for (size_t length = 0; length + 12 < image.size(); ++length) {
            const std::string error = errorOf(Bytes(image.begin(), image.begin() + static_cast<ptrdiff_t>(length)));
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
    EXPECT_NE(errorOf(png), "none");
    if (!kDecodesWebp)
        return;
    // Sizes that are believed, of one colour.
    const Bytes webp = webpImage(16383, 1025, Bytes(size_t{16383} * 1025 * 4));
    EXPECT_LT(webp.size(), 4096u);
    EXPECT_EQ(errorOf(webp), "image 0 has 16383 x 1025 texels in " + std::to_string(webp.size()) + " bytes");
}
