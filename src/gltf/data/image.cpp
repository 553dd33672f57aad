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

using Encoded = std::span<const std::uint8_t>;
using namespace std::string_view_literals;

constexpr std::uint32_t kMostTexels = 16384; // in each direction
// A small file can be a large image: 16384 x 16384 texels of one colour are 22 bytes of WebP. Images of real textures
// have more than 1 byte for this many texels.
constexpr std::uint64_t kMostTexelsPerByte = 1024;
constexpr std::uint64_t kAlwaysAllowed = std::uint64_t{1} << 24;

bool has(Encoded encoded, std::size_t offset, std::string_view bytes)
{
    return encoded.size() >= offset + bytes.size() &&
           std::memcmp(encoded.data() + offset, bytes.data(), bytes.size()) == 0;
}

// Memory for an image of this size, once it is believable.
Image imageOf(std::uint64_t width, std::uint64_t height, Encoded encoded, const std::string &what)
{
    const std::string size = std::to_string(width) + " x " + std::to_string(height) + " texels";
    if (width == 0 || height == 0 || width > kMostTexels || height > kMostTexels)
        throw GltfError(what + " has " + size);
    if (width * height > std::max(kAlwaysAllowed, kMostTexelsPerByte * encoded.size()))
        throw GltfError(what + " has " + size + " in " + std::to_string(encoded.size()) + " bytes");
    return {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), {}, {}};
}

void allocate(Image &image)
{
    image.rgba.resize(std::size_t{4} * image.width * image.height);
}

[[noreturn]] void fail(const std::string &what, const std::string &why)
{
    throw GltfError(what + " cannot be decoded: " + why);
}

// libpng reports errors by longjmp, over nothing here that has a destructor.
class PngReader
{
public:
    PngReader(Encoded encoded, const std::string &what) : m_rest(encoded), m_encoded(encoded), m_what(what)
    {
        m_png = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, onError, onWarning);
        m_info = m_png == nullptr ? nullptr : png_create_info_struct(m_png);
        if (m_info == nullptr)
            throw std::bad_alloc();
    }
    ~PngReader() { png_destroy_read_struct(&m_png, &m_info, nullptr); }
    PngReader(const PngReader &) = delete;
    PngReader &operator=(const PngReader &) = delete;

    Image read()
    {
        if (!readHeader())
            fail(m_what, m_message);
        Image image =
            imageOf(png_get_image_width(m_png, m_info), png_get_image_height(m_png, m_info), m_encoded, m_what);
        // Deflate takes at least 1 byte for 1032: what is not there need not be waited for.
        if (png_get_rowbytes(m_png, m_info) * image.height > std::uint64_t{1032} * m_encoded.size())
            fail(m_what, "it is cut off");
        const bool wide = png_get_bit_depth(m_png, m_info) == 16;
        allocate(image);
        std::vector<std::uint8_t> wideRows(wide ? 2 * image.rgba.size() : 0);
        if (!readRows(wide ? wideRows.data() : image.rgba.data(), image.height,
                      std::size_t{wide ? 8u : 4u} * image.width))
            fail(m_what, m_message);
        if (wide)
            takeWide(wideRows, image);
        return image;
    }

private:
    static void onError(png_structp png, png_const_charp message)
    {
        static_cast<PngReader *>(png_get_error_ptr(png))->m_message = message;
        longjmp(png_jmpbuf(png), 1);
    }
    static void onWarning(png_structp, png_const_charp) {}
    static void onRead(png_structp png, png_bytep target, std::size_t bytes)
    {
        auto *reader = static_cast<PngReader *>(png_get_io_ptr(png));
        if (bytes > reader->m_rest.size())
            png_error(png, "it is cut off");
        std::memcpy(target, reader->m_rest.data(), bytes);
        reader->m_rest = reader->m_rest.subspan(bytes);
    }

    // Four channels of 16 bits each, the upper byte first.
    static void takeWide(const std::vector<std::uint8_t> &rows, Image &image)
    {
        image.alpha16.resize(image.rgba.size() / 4);
        for (std::size_t i = 0; i < image.rgba.size(); ++i)
            image.rgba[i] = rows[2 * i];
        for (std::size_t i = 0; i < image.alpha16.size(); ++i)
            image.alpha16[i] = static_cast<std::uint16_t>(rows[8 * i + 6] << 8 | rows[8 * i + 7]);
    }

    bool readHeader()
    {
        if (setjmp(png_jmpbuf(m_png)) != 0)
            return false;
        png_set_read_fn(m_png, this, onRead);
        png_set_user_limits(m_png, kMostTexels, kMostTexels);
        // Neither colour profiles nor text.
        png_set_keep_unknown_chunks(m_png, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
        png_read_info(m_png, m_info);
        return true;
    }

    bool readRows(std::uint8_t *rows, std::uint32_t height, std::size_t rowBytes)
    {
        if (setjmp(png_jmpbuf(m_png)) != 0)
            return false;
        png_set_expand(m_png); // palettes, fewer than 8 bits, and transparent colours
        png_set_gray_to_rgb(m_png);
        png_set_add_alpha(m_png, 0xffff, PNG_FILLER_AFTER); // of 8 bits the lower half
        const int passes = png_set_interlace_handling(m_png);
        png_read_update_info(m_png, m_info);
        if (png_get_rowbytes(m_png, m_info) != rowBytes)
            png_error(m_png, "its rows have the wrong size");
        for (int pass = 0; pass < passes; ++pass)
            for (std::uint32_t row = 0; row < height; ++row)
                png_read_row(m_png, rows + row * rowBytes, nullptr);
        return true;
    }

    png_structp m_png = nullptr;
    png_infop m_info = nullptr;
    Encoded m_rest;
    Encoded m_encoded;
    const std::string &m_what;
    std::string m_message; // libpng's is gone after the jump
};

// What the headers of a JPEG say that libjpeg does not tell apart, or believes.
void checkJpeg(Encoded encoded, const std::string &what)
{
    constexpr std::size_t kMostScans = 128; // each of them may go over the whole image
    std::size_t scans = 0;
    for (std::size_t i = 2; i + 9 < encoded.size(); ++i) {
        if (encoded[i] != 0xff)
            continue;
        const std::uint8_t marker = encoded[i + 1];
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
            i += 1u + (std::size_t{encoded[i + 2]} << 8 | encoded[i + 3]); // to the next marker
    }
}

// libjpeg reports errors by a function that must not return: by longjmp, over nothing here that has a destructor.
class JpegReader
{
public:
    JpegReader(Encoded encoded, const std::string &what) : m_encoded(encoded), m_what(what)
    {
        m_jpeg.err = jpeg_std_error(&m_errors);
        m_errors.error_exit = onError;
        m_errors.emit_message = onMessage;
        m_jpeg.client_data = this;
    }
    ~JpegReader() { jpeg_destroy_decompress(&m_jpeg); }
    JpegReader(const JpegReader &) = delete;
    JpegReader &operator=(const JpegReader &) = delete;

    Image read()
    {
        if (!readHeader())
            fail(m_what, m_message.data());
        if (m_jpeg.num_components != 1 && m_jpeg.num_components != 3)
            throw GltfUnsupported(m_what + " is a JPEG of " + std::to_string(m_jpeg.num_components) + " components");
        Image image = imageOf(m_jpeg.image_width, m_jpeg.image_height, m_encoded, m_what);
        allocate(image);
        if (!readRows(image.rgba.data(), std::size_t{4} * image.width))
            fail(m_what, m_message.data());
        if (m_cutOff)
            fail(m_what, "it is cut off");
        return image;
    }

private:
    static JpegReader &readerOf(j_common_ptr jpeg) { return *static_cast<JpegReader *>(jpeg->client_data); }
    static void onError(j_common_ptr jpeg)
    {
        JpegReader &reader = readerOf(jpeg);
        jpeg->err->format_message(jpeg, reader.m_message.data());
        longjmp(reader.m_return, 1);
    }
    // Warnings are of files that read all the same; but for one.
    static void onMessage(j_common_ptr jpeg, int)
    {
        if (jpeg->err->msg_code == JWRN_JPEG_EOF)
            readerOf(jpeg).m_cutOff = true;
    }

    bool readHeader()
    {
        if (setjmp(m_return) != 0)
            return false;
        jpeg_create_decompress(&m_jpeg);
        jpeg_mem_src(&m_jpeg, m_encoded.data(), static_cast<unsigned long>(m_encoded.size()));
        jpeg_read_header(&m_jpeg, TRUE);
        return true;
    }

    bool readRows(std::uint8_t *rows, std::size_t rowBytes)
    {
        if (setjmp(m_return) != 0)
            return false;
        m_jpeg.out_color_space = JCS_EXT_RGBA; // alpha is 255
        jpeg_start_decompress(&m_jpeg);
        while (m_jpeg.output_scanline < m_jpeg.output_height && !m_cutOff) {
            std::uint8_t *row = rows + m_jpeg.output_scanline * rowBytes;
            jpeg_read_scanlines(&m_jpeg, &row, 1);
        }
        return true;
    }

    jpeg_decompress_struct m_jpeg{};
    jpeg_error_mgr m_errors{};
    jmp_buf m_return{};
    std::array<char, JMSG_LENGTH_MAX> m_message{};
    bool m_cutOff = false;
    Encoded m_encoded;
    const std::string &m_what;
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
    Image image =
        imageOf(static_cast<std::uint64_t>(features.width), static_cast<std::uint64_t>(features.height), encoded, what);
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
