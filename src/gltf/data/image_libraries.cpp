// SPDX-License-Identifier: Apache-2.0
// Uses libpng, libjpeg and libwebp.
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <jerror.h>
#include <jpeglib.h>
#include <png.h>
#include <webp/decode.h>

#include "gltf/data/image_formats.h"

namespace vellum
{
namespace
{

// libpng reports errors by longjmp, over nothing here that has a destructor.
class PngReader
{
public:
    PngReader(Encoded encoded, const std::string &what) : rest_(encoded), encoded_(encoded), what_(what)
    {
        png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, onError, onWarning);
        info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
        if (info_ == nullptr) {
            png_destroy_read_struct(&png_, nullptr, nullptr);
            throw std::bad_alloc();
        }
    }
    ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
    PngReader(const PngReader &) = delete;
    PngReader &operator=(const PngReader &) = delete;

    Image read()
    {
        if (!readHeader())
            failToDecode(what_, message_);
        Image image = imageOf(png_get_image_width(png_, info_), png_get_image_height(png_, info_), encoded_, what_);
        checkDeflated(png_get_rowbytes(png_, info_) * image.height, encoded_, what_);
        const bool wide = png_get_bit_depth(png_, info_) == 16;
        image.rgba.resize(size_t{4} * image.width * image.height);
        std::vector<uint8_t> wideRows(wide ? 2 * image.rgba.size() : 0);
        if (!readRows(wide ? wideRows.data() : image.rgba.data(), image.height, size_t{wide ? 8u : 4u} * image.width))
            failToDecode(what_, message_);
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

    bool readHeader()
    {
        if (setjmp(png_jmpbuf(png_)) != 0)
            return false;
        png_set_read_fn(png_, this, onRead);
        png_set_user_limits(png_, kMostTexels, kMostTexels);
        // Skips colour profiles and text.
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
            fail();
        Image image = imageOf(jpeg_.image_width, jpeg_.image_height, encoded_, what_);
        image.rgba.resize(size_t{4} * image.width * image.height);
        if (!readRows(image.rgba.data(), size_t{4} * image.width))
            fail();
        if (cutOff_)
            failToDecode(what_, "it is cut off");
        return image;
    }

private:
    [[noreturn]] void fail() const
    {
        if (lacksMemory_)
            throw std::bad_alloc();
        failToDecode(what_, message_.data());
    }
    static JpegReader &readerOf(j_common_ptr jpeg) { return *static_cast<JpegReader *>(jpeg->client_data); }
    static void onError(j_common_ptr jpeg)
    {
        JpegReader &reader = readerOf(jpeg);
        jpeg->err->format_message(jpeg, reader.message_.data());
        reader.lacksMemory_ = jpeg->err->msg_code == JERR_OUT_OF_MEMORY;
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
    bool cutOff_ = false, lacksMemory_ = false;
    Encoded encoded_;
    const std::string &what_;
};

} // namespace

const bool kDecodesWebpAndAvif = true;

Image readPng(Encoded encoded, const std::string &what)
{
    return PngReader(encoded, what).read();
}

Image readJpeg(Encoded encoded, const std::string &what)
{
    return JpegReader(encoded, what).read();
}

Image readWebp(Encoded encoded, const std::string &what)
{
    WebPBitstreamFeatures features;
    if (WebPGetFeatures(encoded.data(), encoded.size(), &features) != VP8_STATUS_OK)
        failToDecode(what, "it is no WebP image");
    if (features.has_animation != 0)
        throw GltfUnsupported(what + " is an animation");
    Image image = imageOf(static_cast<uint64_t>(features.width), static_cast<uint64_t>(features.height), encoded, what);
    image.rgba.resize(size_t{4} * image.width * image.height);
    if (WebPDecodeRGBAInto(encoded.data(), encoded.size(), image.rgba.data(), image.rgba.size(),
                           static_cast<int>(4 * image.width)) == nullptr)
        failToDecode(what, "it is damaged or cut off");
    return image;
}

} // namespace vellum
