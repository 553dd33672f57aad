// SPDX-License-Identifier: Apache-2.0
#include <avif/avif.h>
#include <memory>
#include <stdexcept>
#include <webp/encode.h>

#include "compressed.h"

namespace vellum::test
{
namespace
{

void check(avifResult result)
{
    if (result != AVIF_RESULT_OK)
        throw std::runtime_error(std::string("libavif cannot encode the test's image: ") + avifResultToString(result));
}

struct DestroyImage {
    void operator()(::avifImage *image) const { avifImageDestroy(image); }
};
using ImagePointer = std::unique_ptr<::avifImage, DestroyImage>;

ImagePointer planesOf(uint32_t width, uint32_t height, const std::vector<uint16_t> &rgba, const AvifKind &kind)
{
    ImagePointer image(avifImageCreate(width, height, kind.depth, AVIF_PIXEL_FORMAT_YUV444));
    image->yuvRange = AVIF_RANGE_FULL;
    image->matrixCoefficients = AVIF_MATRIX_COEFFICIENTS_IDENTITY; // GBR
    image->alphaPremultiplied = kind.premultiplied ? AVIF_TRUE : AVIF_FALSE;
    if (kind.rotation != 0) {
        image->transformFlags |= AVIF_TRANSFORM_IROT;
        image->irot.angle = kind.rotation;
    }
    if (kind.mirrored)
        image->transformFlags |= AVIF_TRANSFORM_IMIR;
    if (kind.cropped) {
        image->transformFlags |= AVIF_TRANSFORM_CLAP;
        image->clap = {width - 2, 1, height, 1, 0, 1, 0, 1};
    }
    avifRGBImage rgb;
    avifRGBImageSetDefaults(&rgb, image.get());
    rgb.alphaPremultiplied = image->alphaPremultiplied;
    rgb.ignoreAlpha = kind.alpha ? AVIF_FALSE : AVIF_TRUE;
    Bytes narrow(rgba.begin(), rgba.end());
    std::vector<uint16_t> wide = rgba;
    rgb.pixels = kind.depth > 8 ? reinterpret_cast<uint8_t *>(wide.data()) : narrow.data();
    rgb.rowBytes = (kind.depth > 8 ? 8 : 4) * width;
    check(avifImageRGBToYUV(image.get(), &rgb));
    return image;
}

} // namespace

Bytes webpImage(uint32_t width, uint32_t height, const Bytes &rgba)
{
    uint8_t *encoded = nullptr;
    const size_t size = WebPEncodeLosslessRGBA(rgba.data(), static_cast<int>(width), static_cast<int>(height),
                                               static_cast<int>(4 * width), &encoded);
    const Bytes bytes(encoded, encoded + size);
    WebPFree(encoded);
    return bytes;
}

Bytes avifImage(uint32_t width, uint32_t height, const std::vector<uint16_t> &rgba, const AvifKind &kind)
{
    const ImagePointer image = planesOf(width, height, rgba, kind);
    const std::unique_ptr<avifEncoder, decltype(&avifEncoderDestroy)> encoder(avifEncoderCreate(), avifEncoderDestroy);
    encoder->speed = AVIF_SPEED_FASTEST;
    encoder->minQuantizer = encoder->maxQuantizer = AVIF_QUANTIZER_LOSSLESS;
    encoder->minQuantizerAlpha = encoder->maxQuantizerAlpha = AVIF_QUANTIZER_LOSSLESS;
    const avifAddImageFlags single = kind.frames > 1 ? AVIF_ADD_IMAGE_FLAG_NONE : AVIF_ADD_IMAGE_FLAG_SINGLE;
    if (kind.columns > 1) {
        const std::vector<const ::avifImage *> cells(kind.columns, image.get());
        check(avifEncoderAddImageGrid(encoder.get(), kind.columns, 1, cells.data(), single));
    } else {
        for (unsigned i = 0; i < kind.frames; ++i)
            check(avifEncoderAddImage(encoder.get(), image.get(), 1, single));
    }
    avifRWData encoded = AVIF_DATA_EMPTY;
    const avifResult result = avifEncoderFinish(encoder.get(), &encoded);
    const Bytes bytes(encoded.data, encoded.data + encoded.size);
    avifRWDataFree(&encoded);
    check(result);
    return bytes;
}

} // namespace vellum::test
