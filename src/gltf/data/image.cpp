// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/image.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <jerror.h>
#include <jpeglib.h>
#include <memory>
#include <png.h>
#include <string_view>
#include <webp/decode.h>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

using Encoded = std::span<const uint8_t>;
using namespace std::string_view_literals;

constexpr uint32_t kMostTexels = 16384; // in each direction
// A small file can be a large image: 16384 x 16384 texels of one colour are 22 bytes of WebP. Images of real textures
// have more than 1 byte for this many texels.
constexpr uint64_t kMostTexelsPerByte = 1024;
constexpr uint64_t kAlwaysAllowed = uint64_t{1} << 24;

bool has(Encoded encoded, size_t offset, std::string_view bytes)
{
    return encoded.size() >= offset + bytes.size() &&
           std::memcmp(encoded.data() + offset, bytes.data(), bytes.size()) == 0;
}

// Memory for an image of this size, once it is believable.
Image imageOf(uint64_t width, uint64_t height, Encoded encoded, const std::string &what)
{
    const std::string size = std::to_string(width) + " x " + std::to_string(height) + " texels";
    if (width == 0 || height == 0 || width > kMostTexels || height > kMostTexels)
        throw GltfError(what + " has " + size);
    if (width * height > std::max(kAlwaysAllowed, kMostTexelsPerByte * encoded.size()))
        throw GltfError(what + " has " + size + " in " + std::to_string(encoded.size()) + " bytes");
    return {static_cast<uint32_t>(width), static_cast<uint32_t>(height), {}, {}};
}

void allocate(Image &image)
{
    image.rgba.resize(size_t{4} * image.width * image.height);
}

[[noreturn]] void fail(const std::string &what, const std::string &why)
{
    throw GltfError(what + " cannot be decoded: " + why);
}

// libpng reports errors by longjmp, over nothing here that has a destructor.
class PngReader
{
public:
    PngReader(Encoded encoded, const std::string &what) : rest_(encoded), encoded_(encoded), what_(what)
    {
        png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, onError, onWarning);
        info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
        if (info_ == nullptr)
            throw std::bad_alloc();
    }
    ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
    PngReader(const PngReader &) = delete;
    PngReader &operator=(const PngReader &) = delete;

    Image read()
    {
        if (!readHeader())
            fail(what_, message_);
        Image image = imageOf(png_get_image_width(png_, info_), png_get_image_height(png_, info_), encoded_, what_);
        // Deflate takes at least 1 byte for 1032: what is not there need not be waited for.
        if (png_get_rowbytes(png_, info_) * image.height > uint64_t{1032} * encoded_.size())
            fail(what_, "it is cut off");
        const bool wide = png_get_bit_depth(png_, info_) == 16;
        allocate(image);
        std::vector<uint8_t> wideRows(wide ? 2 * image.rgba.size() : 0);
        if (!readRows(wide ? wideRows.data() : image.rgba.data(), image.height, size_t{wide ? 8u : 4u} * image.width))
            fail(what_, message_);
        if (wide)
            takeWide(wideRows, image);
        return image;
    }

private:
    static void onError(png_structp png, png_const_charp message)
    {
        static_cast<PngReader *>(png_get_error_ptr(png))->message_ = message;
        longjmp(png_jmpbuf(png), 1);
    }
    static void onWarning(png_structp, png_const_charp) {}
    static void onRead(png_structp png, png_bytep target, size_t bytes)
    {
        auto *reader = static_cast<PngReader *>(png_get_io_ptr(png));
        if (bytes > reader->rest_.size())
            png_error(png, "it is cut off");
        std::memcpy(target, reader->rest_.data(), bytes);
        reader->rest_ = reader->rest_.subspan(bytes);
    }

    // Four channels of 16 bits each, the upper byte first.
    static void takeWide(const std::vector<uint8_t> &rows, Image &image)
    {
        image.alpha16.resize(image.rgba.size() / 4);
        for (size_t i = 0; i < image.rgba.size(); ++i)
            image.rgba[i] = rows[2 * i];
        for (size_t i = 0; i < image.alpha16.size(); ++i)
            image.alpha16[i] = static_cast<uint16_t>(rows[8 * i + 6] << 8 | rows[8 * i + 7]);
    }

    bool readHeader()
    {
        if (setjmp(png_jmpbuf(png_)) != 0)
            return false;
        png_set_read_fn(png_, this, onRead);
        png_set_user_limits(png_, kMostTexels, kMostTexels);
        // Neither colour profiles nor text.
        png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
        png_read_info(png_, info_);
        return true;
    }

    bool readRows(uint8_t *rows, uint32_t height, size_t rowBytes)
    {
        if (setjmp(png_jmpbuf(png_)) != 0)
            return false;
        png_set_expand(png_); // palettes, fewer than 8 bits, and transparent colours
        png_set_gray_to_rgb(png_);
        png_set_add_alpha(png_, 0xffff, PNG_FILLER_AFTER); // of 8 bits the lower half
        const int passes = png_set_interlace_handling(png_);
        png_read_update_info(png_, info_);
        if (png_get_rowbytes(png_, info_) != rowBytes)
            png_error(png_, "its rows have the wrong size");
        for (int pass = 0; pass < passes; ++pass)
            for (uint32_t row = 0; row < height; ++row)
                png_read_row(png_, rows + row * rowBytes, nullptr);
        return true;
    }

    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
    Encoded rest_;
    Encoded encoded_;
    const std::string &what_;
    std::string message_; // libpng's is gone after the jump
};

// What the headers of a JPEG say that libjpeg does not tell apart, or believes.
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
        }
        if (marker == 0xda && ++scans > kMostScans)
            fail(what, "it has too many scans");
        if (scans == 0 && marker != 0xff && marker != 0)
            i += 1u + (size_t{encoded[i + 2]} << 8 | encoded[i + 3]); // to the next marker
    }
}

// libjpeg reports errors by a function that must not return: by longjmp, over nothing here that has a destructor.
class JpegReader
{
public:
    JpegReader(Encoded encoded, const std::string &what) : encoded_(encoded), what_(what)
    {
        jpeg_.err = jpeg_std_error(&errors_);
        errors_.error_exit = onError;
        errors_.emit_message = onMessage;
        jpeg_.client_data = this;
    }
    ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
    JpegReader(const JpegReader &) = delete;
    JpegReader &operator=(const JpegReader &) = delete;

    Image read()
    {
        if (!readHeader())
            fail(what_, message_.data());
        if (jpeg_.num_components != 1 && jpeg_.num_components != 3)
            throw GltfUnsupported(what_ + " is a JPEG of " + std::to_string(jpeg_.num_components) + " components");
        Image image = imageOf(jpeg_.image_width, jpeg_.image_height, encoded_, what_);
        allocate(image);
        if (!readRows(image.rgba.data(), size_t{4} * image.width))
            fail(what_, message_.data());
        if (cutOff_)
            fail(what_, "it is cut off");
        return image;
    }

private:
    static JpegReader &readerOf(j_common_ptr jpeg) { return *static_cast<JpegReader *>(jpeg->client_data); }
    static void onError(j_common_ptr jpeg)
    {
        JpegReader &reader = readerOf(jpeg);
        jpeg->err->format_message(jpeg, reader.message_.data());
        longjmp(reader.return_, 1);
    }
    // Files with warnings can be read, except those that end too early.
    static void onMessage(j_common_ptr jpeg, int)
    {
        if (jpeg->err->msg_code == JWRN_JPEG_EOF)
            readerOf(jpeg).cutOff_ = true;
    }

    bool readHeader()
    {
        if (setjmp(return_) != 0)
            return false;
        jpeg_create_decompress(&jpeg_);
        jpeg_mem_src(&jpeg_, encoded_.data(), static_cast<unsigned long>(encoded_.size()));
        jpeg_read_header(&jpeg_, TRUE);
        return true;
    }

    bool readRows(uint8_t *rows, size_t rowBytes)
    {
        if (setjmp(return_) != 0)
            return false;
        jpeg_.out_color_space = JCS_EXT_RGBA; // alpha is 255
        jpeg_start_decompress(&jpeg_);
        while (jpeg_.output_scanline < jpeg_.output_height && !cutOff_) {
            uint8_t *row = rows + jpeg_.output_scanline * rowBytes;
            jpeg_read_scanlines(&jpeg_, &row, 1);
        }
        return true;
    }

    jpeg_decompress_struct jpeg_{};
    jpeg_error_mgr errors_{};
    jmp_buf return_{};
    std::array<char, JMSG_LENGTH_MAX> message_{};
    bool cutOff_ = false;
    Encoded encoded_;
    const std::string &what_;
};

Image readJpeg(Encoded encoded, const std::string &what)
{
    checkJpeg(encoded, what);
    return JpegReader(encoded, what).read();
}

Image readWebp(Encoded encoded, const std::string &what)
{
    WebPBitstreamFeatures features;
    if (WebPGetFeatures(encoded.data(), encoded.size(), &features) != VP8_STATUS_OK)
        fail(what, "it is no WebP image");
    if (features.has_animation != 0)
        throw GltfUnsupported(what + " is an animation");
    Image image = imageOf(static_cast<uint64_t>(features.width), static_cast<uint64_t>(features.height), encoded, what);
    allocate(image);
    if (WebPDecodeRGBAInto(encoded.data(), encoded.size(), image.rgba.data(), image.rgba.size(),
                           static_cast<int>(4 * image.width)) == nullptr)
        fail(what, "it is damaged or cut off");
    return image;
}

} // namespace

Image decodeImage(Encoded encoded, const std::string &what)
{
    if (encoded.empty())
        throw GltfError(what + " is empty");
    if (has(encoded, 0, "\x89PNG\r\n\x1a\n"sv))
        return PngReader(encoded, what).read();
    if (has(encoded, 0, "\xff\xd8\xff"sv))
        return readJpeg(encoded, what);
    if (has(encoded, 0, "RIFF"sv) && has(encoded, 8, "WEBP"sv))
        return readWebp(encoded, what);
    if (has(encoded, 0, "\xabKTX 20\xbb\r\n\x1a\n"sv))
        throw GltfUnsupported(what + " is a KTX2 file, which is not supported");
    if (has(encoded, 4, "ftyp"sv))
        throw GltfUnsupported(what + " is an AVIF file, which is not supported");
    if (has(encoded, 0, "DDS "sv))
        throw GltfUnsupported(what + " is a DDS file, which is not supported");
    fail(what, "it is neither PNG nor JPEG nor WebP");
}

} // namespace vellum
