// SPDX-License-Identifier: Apache-2.0
#include "gltf/alpha_textures.h"

#include <algorithm>

#include "core/hash.h"
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

std::shared_ptr<const Image> DecodedImages::get(std::span<const uint8_t> encoded, const std::function<Image()> &decode)
{
    const uint64_t key = hashBytes(encoded.data(), encoded.size());
    std::unique_lock lock(mutex_);
    if (const auto found = found_.find(key); found != found_.end()) {
        entries_.splice(entries_.begin(), entries_, found->second);
        const auto waiting = found->second->decoded;
        lock.unlock();
        const std::shared_ptr<const Decoded> decoded = waiting.get();
        if (decoded && std::equal(encoded.begin(), encoded.end(), decoded->encoded.begin(), decoded->encoded.end()))
            return {decoded, &decoded->image};
        return std::make_shared<const Image>(decode()); // it failed, or is another one with the same hash
    }
    std::promise<std::shared_ptr<const Decoded>> promise;
    entries_.push_front({key, promise.get_future().share(), 0});
    const Entries::iterator entry = entries_.begin();
    try {
        found_.emplace(key, entry);
    } catch (...) {
        entries_.pop_front();
        throw;
    }
    lock.unlock();
    std::shared_ptr<const Decoded> decoded;
    try {
        decoded = std::make_shared<const Decoded>(Decoded{{encoded.begin(), encoded.end()}, decode()});
    } catch (...) {
        lock.lock();
        found_.erase(key);
        entries_.erase(entry);
        lock.unlock();
        promise.set_value(nullptr);
        throw;
    }
    promise.set_value(decoded);
    lock.lock();
    keep(entry, encoded.size() + decoded->image.rgba.size() + 2 * decoded->image.alpha16.size());
    return {decoded, &decoded->image};
}

// Counts an entry, and drops those that were not used for the longest time.
void DecodedImages::keep(Entries::iterator entry, size_t bytes)
{
    constexpr size_t kBookkeeping = 512; // of an entry, at most
    entry->bytes = bytes + kBookkeeping;
    bytes_ += entry->bytes;
    for (auto last = entries_.end(); bytes_ > mostBytes_ && last != entries_.begin();) {
        --last;
        if (last->bytes == 0)
            continue; // being decoded
        bytes_ -= last->bytes;
        found_.erase(last->key);
        last = entries_.erase(last);
    }
}

ImageDecoder::ImageDecoder(const Document &document, DecodedImages *shared)
    : document_(document), shared_(shared), allowance_(kAlwaysAllowed)
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

// Counts the bytes of a file of its own.
void ImageDecoder::allow(int image, const EncodedImage &encoded)
{
    const std::string &uri = document_.model().images[static_cast<size_t>(image)].uri;
    if (!uri.empty() && files_.insert(uri).second)
        allowance_ += kTexelsPerByte * encoded.bytes().size();
}

Image ImageDecoder::decode(int image, const EncodedImage &encoded)
{
    allow(image, encoded);
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

std::shared_ptr<const Image> ImageDecoder::decodeShared(int image, const EncodedImage &encoded)
{
    if (shared_ == nullptr)
        return std::make_shared<const Image>(decode(image, encoded));
    bool decoded = false;
    auto found = shared_->get(encoded.bytes(), [&] {
        decoded = true;
        return decode(image, encoded);
    });
    if (!decoded) { // a file that fails for its texels fails with shared images as well
        allow(image, encoded);
        account(uint64_t{found->width} * found->height);
    }
    return found;
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
        image_.reset(); // before the next one is decoded
        decoded_ = material.image;
        failure_ = nullptr;
        try {
            image_ = images_.decodeShared(material.image, encoded(material.image));
            encoded_.erase(material.image);
        } catch (...) {
            failure_ = std::current_exception();
        }
    }
    if (material.image >= 0 && failure_)
        std::rethrow_exception(failure_);
    static const Image kNone;
    texture_ = std::make_shared<AlphaTexture>(alphaTexture(material, material.image >= 0 ? *image_ : kNone, image_));
    images_.account(texture_->texelCount());
    key_ = key;
    return texture_;
}

} // namespace vellum
