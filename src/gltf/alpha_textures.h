// SPDX-License-Identifier: Apache-2.0
// Decodes the images of a document as far as its size allows: a small file can have many large images, and materials
// that read one of them with many samplers and factors.
#pragma once

#include <exception>
#include <functional>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "gltf/primitive.h"

namespace vellum
{

// Decoded images that the files of one run share: those that were used last, of some bytes together. Safe to use from
// several threads, one of which decodes an image while the others wait for it.
class DecodedImages
{
public:
    // By default as many as four of 4096 x 4096.
    explicit DecodedImages(size_t mostBytes = size_t{256} << 20) : mostBytes_(mostBytes) {}

    // The image of these bytes, by decode() where it is not kept. Throws what decode() throws; then those that waited
    // decode it themselves.
    std::shared_ptr<const Image> get(std::span<const uint8_t> encoded, const std::function<Image()> &decode);

private:
    struct Decoded {
        std::vector<uint8_t> encoded;
        Image image;
    };
    struct Entry {
        uint64_t key;                                               // a hash of the encoded bytes
        std::shared_future<std::shared_ptr<const Decoded>> decoded; // null after a failure
        size_t bytes;                                               // 0 until it is decoded
    };
    using Entries = std::list<Entry>;
    void keep(Entries::iterator entry, size_t bytes);

    size_t mostBytes_;
    std::mutex mutex_;
    Entries entries_; // the one that was used last in front
    std::unordered_map<uint64_t, Entries::iterator> found_;
    size_t bytes_ = 0;
};

// Decodes images. Not more texels than their bytes can be worth, and some in addition.
class ImageDecoder
{
public:
    // `shared` may be null.
    explicit ImageDecoder(const Document &document, DecodedImages *shared = nullptr);

    // Throws what readImage() throws, and GltfError for too many texels.
    Image decode(int image) { return decode(image, readEncodedImage(document_, image)); }
    Image decode(int image, const EncodedImage &encoded);
    // One of the shared images, if there are any.
    std::shared_ptr<const Image> decodeShared(int image, const EncodedImage &encoded);
    // Counts other work on that many texels. Throws GltfError for too many.
    void account(uint64_t texels);

private:
    void allow(int image, const EncodedImage &encoded);

    const Document &document_;
    DecodedImages *shared_;
    uint64_t allowance_;          // of texels
    std::set<std::string> files_; // files counted in it
};

// The parameters that determine the alpha at a texture coordinate.
using TextureKey = std::tuple<int, Wrap, Wrap, Filter, float>;
TextureKey textureKeyOf(const Material &material);

// Makes the alpha textures of materials. Equal ones, and those with the same image, should be requested consecutively:
// the last one and its image are cached.
class AlphaTextures
{
public:
    // `shared` may be null.
    explicit AlphaTextures(const Document &document, DecodedImages *shared = nullptr)
        : document_(document), images_(document, shared)
    {
    }

    // An image as it is stored, which is kept for of(): both see the same bytes, whatever happens to its file. Throws
    // what readEncodedImage() throws.
    const EncodedImage &encoded(int image);
    // Drops the images that encoded() keeps.
    void forgetEncoded() { encoded_.clear(); }
    // Throws what readImage() throws, and GltfError for too many texels.
    std::shared_ptr<const AlphaTexture> of(const Material &material);
    [[nodiscard]] ImageDecoder &images() { return images_; }

private:
    const Document &document_;
    ImageDecoder images_;
    std::map<int, EncodedImage> encoded_;
    int decoded_ = -1; // the number of image_
    std::shared_ptr<const Image> image_;
    std::exception_ptr failure_;    // why the last one failed
    std::optional<TextureKey> key_; // of texture_
    std::shared_ptr<const AlphaTexture> texture_;
};

} // namespace vellum
