// SPDX-License-Identifier: Apache-2.0
// Decodes the images of a document as far as its size allows: a small file can have many large images, and materials
// that read one of them with many samplers and factors.
#pragma once

#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include "gltf/primitive.h"

namespace vellum
{

// Decodes images. Not more texels than their bytes can be worth, and some in addition.
class ImageDecoder
{
public:
    explicit ImageDecoder(const Document &document);

    // Throws what readImage() throws, and GltfError for too many texels.
    Image decode(int image) { return decode(image, readEncodedImage(document_, image)); }
    Image decode(int image, const EncodedImage &encoded);
    // Counts other work on that many texels. Throws GltfError for too many.
    void account(uint64_t texels);

private:
    const Document &document_;
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
    explicit AlphaTextures(const Document &document) : document_(document), images_(document) {}

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
    Image image_;
    std::exception_ptr failure_;    // why the last one failed
    std::optional<TextureKey> key_; // of texture_
    std::shared_ptr<const AlphaTexture> texture_;
};

} // namespace vellum
