// SPDX-License-Identifier: Apache-2.0
// Uses libavif, whose AV1 decoder (dav1d) prints messages of its own about damaged data on stderr.
#include <algorithm>
#include <avif/avif.h>
#include <cstring>
#include <memory>
#include <new>
#include <string_view>

#include "gltf/data/image_formats.h"

namespace vellum
{
namespace
{

using namespace std::string_view_literals;

// Takes big-endian numbers from the front of bytes. What is not there reads as nothing: libavif rejects such files.
class BytesReader
{
public:
    explicit BytesReader(Encoded rest) : rest_(rest) {}

    [[nodiscard]] bool empty() const { return rest_.empty(); }
    [[nodiscard]] Encoded rest() const { return rest_; }

    Encoded take(uint64_t size)
    {
        const Encoded taken = rest_.first(std::min<uint64_t>(size, rest_.size()));
        rest_ = rest_.subspan(taken.size());
        return taken;
    }
    uint64_t number(size_t size)
    {
        uint64_t value = 0;
        for (const uint8_t byte : take(size))
            value = value << 8 | byte;
        return value;
    }

private:
    Encoded rest_;
};

struct Box {
    std::string_view type;
    Encoded contents;
};

Box takeBox(BytesReader &from)
{
    uint64_t size = from.number(4);
    const Encoded type = from.take(4);
    uint64_t head = 8;
    if (size == 1) {
        size = from.number(8);
        head = 16;
    }
    const uint64_t contents = size == 0 ? ~uint64_t{0} : size - std::min(size, head); // 0: the rest of the file
    return {{reinterpret_cast<const char *>(type.data()), type.size()}, from.take(contents)};
}

// Rejects animations, and files that make libavif take far more memory or time than their bytes can be worth: a few
// bytes can be a frame of any size that is decoded and not shown, or belong to any number of items.
class BoxCheck
{
public:
    BoxCheck(Encoded file, const std::string &what) : file_(file), what_(what) {}

    void run()
    {
        for (BytesReader boxes(file_); !boxes.empty();) {
            const Box box = takeBox(boxes);
            if (box.type == "moov"sv)
                throw GltfUnsupported(what_ + " is an animation");
            if (box.type == "meta"sv)
                checkMeta(box.contents);
        }
    }

private:
    static constexpr size_t kMostTableBytes = 1u << 16; // libavif compares each item with all others
    static constexpr size_t kMostParts = 1u << 16;
    static constexpr size_t kMostFrames = 128; // each of them may have all texels

    void checkMeta(Encoded meta);
    void checkLocations(Encoded locations, Encoded stored);
    void countFrames(Encoded data);
    void count(size_t &parts, size_t most) const
    {
        if (++parts > most)
            failToDecode(what_, "it has too many parts");
    }

    Encoded file_;
    const std::string &what_;
    size_t parts_ = 0; // of items, and of what AV1 data consists of
    size_t frames_ = 0;
    size_t joined_ = 0; // bytes
};

void BoxCheck::checkMeta(Encoded meta)
{
    Encoded stored; // in "idat"
    Encoded locations;
    size_t tableBytes = 0;
    BytesReader boxes(meta);
    boxes.take(4); // version and flags
    while (!boxes.empty()) {
        const Box box = takeBox(boxes);
        if (box.type == "idat"sv)
            stored = box.contents;
        else if (box.type == "iloc"sv)
            locations = box.contents;
        tableBytes += box.type == "idat"sv ? 0 : box.contents.size();
        if (box.type == "iprp"sv)
            for (BytesReader properties(box.contents); !properties.empty();)
                if (const Box property = takeBox(properties); property.type == "ipco"sv) // may have a colour profile
                    tableBytes -= property.contents.size();
    }
    if (tableBytes > kMostTableBytes)
        failToDecode(what_, "it has too many parts");
    checkLocations(locations, stored);
}

void BoxCheck::checkLocations(Encoded locations, Encoded stored)
{
    BytesReader reader(locations);
    const uint64_t version = reader.number(4) >> 24;
    const uint64_t sizes = reader.number(2);
    const size_t idSize = version < 2 ? 2 : 4;
    const auto sizeAt = [&](unsigned shift) { return sizes >> shift & 15; };
    for (uint64_t items = reader.number(idSize); items > 0 && !reader.empty(); --items) {
        reader.take(idSize);
        const bool inMeta = version > 0 && (reader.number(2) & 15) == 1;
        reader.take(2); // the file that has it: this one
        const Encoded source = inMeta ? stored : file_;
        const uint64_t base = reader.number(sizeAt(4));
        Encoded data;
        std::vector<uint8_t> joined;
        for (uint64_t extents = reader.number(2); extents > 0; --extents) {
            count(parts_, kMostParts);
            if (version > 0)
                reader.take(sizeAt(0));
            const uint64_t offset = base + reader.number(sizeAt(12));
            BytesReader extent(source);
            extent.take(offset);
            const Encoded part = extent.take(reader.number(sizeAt(8)));
            if (data.empty()) {
                data = part;
                continue;
            }
            joined_ += part.size() + (joined.empty() ? data.size() : 0);
            if (joined_ > file_.size())
                failToDecode(what_, "its parts overlap");
            if (joined.empty())
                joined.assign(data.begin(), data.end());
            joined.insert(joined.end(), part.begin(), part.end());
            data = joined;
        }
        countFrames(data);
    }
}

// AV1: "OBU syntax".
void BoxCheck::countFrames(Encoded data)
{
    constexpr uint64_t kFrameHeader = 3;
    constexpr uint64_t kFrame = 6;
    constexpr uint64_t kRedundantFrameHeader = 7;
    for (BytesReader reader(data); !reader.empty();) {
        count(parts_, kMostParts);
        const uint64_t header = reader.number(1);
        const uint64_t type = header >> 3 & 15;
        if (type == kFrameHeader || type == kFrame || type == kRedundantFrameHeader)
            count(frames_, kMostFrames);
        if ((header & 4) != 0)
            reader.take(1); // extension
        uint64_t size = (header & 2) != 0 ? 0 : ~uint64_t{0};
        for (unsigned shift = 0; (header & 2) != 0 && shift < 56; shift += 7) {
            const uint64_t byte = reader.number(1);
            size |= (byte & 0x7f) << shift;
            if ((byte & 0x80) == 0)
                break;
        }
        reader.take(size);
    }
}

struct Destroy {
    void operator()(avifDecoder *decoder) const { avifDecoderDestroy(decoder); }
};

// Browsers do what these say. glTF does not define them.
bool isTransformed(const avifImage &image)
{
    const avifTransformFlags flags = image.transformFlags;
    return (flags & (AVIF_TRANSFORM_CLAP | AVIF_TRANSFORM_IMIR)) != 0 ||
           ((flags & AVIF_TRANSFORM_IROT) != 0 && image.irot.angle != 0);
}

uint64_t scaled(uint64_t value, uint64_t from, uint64_t to)
{
    return (value * to + from / 2) / from;
}

// As it is stored: full range, never multiplied with anything.
void takeAlpha(const avifImage &from, Image &image)
{
    const bool wide = from.depth > 8;
    const uint32_t largest = (1u << from.depth) - 1;
    if (wide)
        image.alpha16.resize(size_t{image.width} * image.height);
    for (size_t y = 0; y < image.height; ++y) {
        const uint8_t *row = from.alphaPlane + y * from.alphaRowBytes;
        for (size_t x = 0; x < image.width; ++x) {
            const size_t texel = y * image.width + x;
            uint16_t value = row[x];
            if (wide) {
                std::memcpy(&value, row + 2 * x, sizeof value);
                value = std::min(value, static_cast<uint16_t>(largest));
                image.alpha16[texel] = static_cast<uint16_t>(scaled(value, largest, 65535));
            }
            image.rgba[4 * texel + 3] = static_cast<uint8_t>(scaled(value, largest, 255));
        }
    }
}

} // namespace

Image readAvif(Encoded encoded, const std::string &what)
{
    const auto check = [&](avifResult result) {
        if (result == AVIF_RESULT_OUT_OF_MEMORY)
            throw std::bad_alloc();
        if (result != AVIF_RESULT_OK)
            failToDecode(what, avifResultToString(result)); // not the decoder's diagnosis, which has bytes of the file
    };
    BoxCheck(encoded, what).run();
    const std::unique_ptr<avifDecoder, Destroy> decoder(avifDecoderCreate());
    if (!decoder)
        throw std::bad_alloc();
    decoder->maxThreads = 1;
    decoder->ignoreExif = AVIF_TRUE;
    decoder->ignoreXMP = AVIF_TRUE;
    decoder->strictFlags = AVIF_STRICT_DISABLED; // these reject what older encoders left out
    decoder->imageDimensionLimit = 0;            // until imageOf() has named the size
    check(avifDecoderSetSource(decoder.get(), AVIF_DECODER_SOURCE_PRIMARY_ITEM));
    check(avifDecoderSetIOMemory(decoder.get(), encoded.data(), encoded.size()));
    check(avifDecoderParse(decoder.get()));
    if (isTransformed(*decoder->image))
        throw GltfUnsupported(what + " is to be rotated, mirrored or cropped (irot, imir, clap), which some renderers "
                                     "do and others do not");
    Image image = imageOf(decoder->image->width, decoder->image->height, encoded, what);
    decoder->imageDimensionLimit = kMostTexels;
    decoder->imageSizeLimit =
        static_cast<uint32_t>(std::min<uint64_t>(mostTexels(encoded), uint64_t{kMostTexels} * kMostTexels));
    check(avifDecoderNextImage(decoder.get()));
    const avifImage &decoded = *decoder->image;
    if (decoded.width != image.width || decoded.height != image.height)
        failToDecode(what, "its header has another size");
    image.rgba.resize(size_t{4} * image.width * image.height);
    avifRGBImage rgba;
    avifRGBImageSetDefaults(&rgba, &decoded); // four channels, not multiplied with alpha
    rgba.depth = 8;
    rgba.pixels = image.rgba.data();
    rgba.rowBytes = 4 * image.width;
    check(avifImageYUVToRGB(&decoded, &rgba));
    if (decoded.alphaPlane != nullptr)
        takeAlpha(decoded, image);
    return image;
}

} // namespace vellum
