// SPDX-License-Identifier: Apache-2.0
#include "gltf/alpha_textures.h"

#include <algorithm>

#include "gltf/data/image.h"

namespace vellum
{
namespace
{

// For files of small images: eight of 4096 x 4096.
constexpr uint64_t kAlwaysAllowed = uint64_t{1} << 27;
constexpr uint64_t kMostOfOne = uint64_t{1} << 24;
// Each image can be used by eight materials with different samplers or factors, however well it is compressed.
constexpr uint64_t kTexelsPerByte = 8 * kMostTexelsPerByte;

} // namespace

ImageDecoder::ImageDecoder(const Document &document) : document_(document), allowance_(kAlwaysAllowed)
{
    const gltf_json::Model &model = document.model();
    for (const gltf_json::Buffer &buffer : model.buffers)
        allowance_ += kTexelsPerByte * buffer.data.size();
    for (const gltf_json::Image &image : model.images)
        allowance_ += kTexelsPerByte * image.data.size();
}

void ImageDecoder::account(uint64_t texels)
{
    if (texels > allowance_)
        throw GltfError("its images have more texels than its size allows, all their uses counted");
    allowance_ -= texels;
}

Image ImageDecoder::decode(int image, const EncodedImage &encoded)
{
    const std::string &uri = document_.model().images[static_cast<size_t>(image)].uri;
    if (!uri.empty() && files_.insert(uri).second)
        allowance_ += kTexelsPerByte * encoded.bytes().size();
    try {
        Image decoded = decodeImage(document_, image, encoded);
        account(uint64_t{decoded.width} * decoded.height);
        return decoded;
    } catch (const GltfError &) {
        // It may have been found at the very end.
        account(std::min(kMostTexelsPerByte * encoded.bytes().size(), kMostOfOne));
        throw;
    }
}

TextureKey textureKeyOf(const Material &material)
{
    return {material.image, material.wrapU, material.wrapV, material.filter, material.baseColor[3]};
}

const EncodedImage &AlphaTextures::encoded(int image)
{
    const auto found = encoded_.find(image);
    if (found != encoded_.end())
        return found->second;
    return encoded_.emplace(image, readEncodedImage(document_, image)).first->second;
}

std::shared_ptr<const AlphaTexture> AlphaTextures::of(const Material &material)
{
    const TextureKey key = textureKeyOf(material);
    if (key_ == key)
        return texture_;
    key_.reset();
    texture_.reset();
    if (material.image >= 0 && decoded_ != material.image) {
        image_ = {}; // before the next one is decoded
        decoded_ = material.image;
        failure_ = nullptr;
        try {
            image_ = images_.decode(material.image, encoded(material.image));
            encoded_.erase(material.image);
        } catch (...) {
            failure_ = std::current_exception();
        }
    }
    if (material.image >= 0 && failure_)
        std::rethrow_exception(failure_);
    texture_ = std::make_shared<AlphaTexture>(alphaTexture(material, image_));
    images_.account(texture_->alpha.size());
    key_ = key;
    return texture_;
}

} // namespace vellum
