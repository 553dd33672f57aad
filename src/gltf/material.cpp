// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <limits>
#include <utility>

#include "base/text.h"
#include "core/portable_math.h"
#include "gltf/data/image.h"
#include "gltf/file/uri.h"
#include "gltf/primitive.h"

namespace vellum
{
namespace
{

// KHR_texture_transform: "Overview" gives the matrix, translation * rotation * scale.
void readTransform(const gltf_json::Material &source, Material &material)
{
    material.uvSet = source.texCoord;
    const JsonValue extension = source.textureExtensions["KHR_texture_transform"];
    if (!extension.isObject())
        return;
    const auto pair = [&](const char *name, double other) {
        const std::vector<double> values = gltf_json::numbersIn(extension, name, "KHR_texture_transform");
        return values.size() == 2 ? std::array{values[0], values[1]} : std::array{other, other};
    };
    const std::array<double, 2> offset = pair("offset", 0);
    const std::array<double, 2> scale = pair("scale", 1);
    const auto [s, c] = sineCosine(gltf_json::numberIn(extension, "rotation", "KHR_texture_transform").value_or(0));
    material.uvTransform = {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
    // Overrides that of the texture, for those who read the extension.
    if (const auto texCoord = gltf_json::indexIn(extension, "texCoord", "KHR_texture_transform"))
        material.uvSet = *texCoord;
}

Wrap wrapOf(int mode)
{
    switch (mode) {
    case gltf_json::kClampToEdge: return Wrap::Clamp;
    case gltf_json::kMirroredRepeat: return Wrap::Mirror;
    default: return Wrap::Repeat;
    }
}

// The image that a renderer takes which reads what is read here: the first by an extension, in the order of three.js;
// the texture's own, also in place of what is not read here; else one of the latter, so that the error is about it.
int imageOf(const gltf_json::Texture &texture, int index, Material &material)
{
    struct Extension {
        const char *name;
        bool isRead;
    };
    const std::array extensions = {Extension{"EXT_texture_webp", kDecodesWebpAndAvif},
                                   Extension{"EXT_texture_avif", kDecodesWebpAndAvif},
                                   Extension{"KHR_texture_basisu", false}, Extension{"MSFT_texture_dds", false}};
    int taken = -1;
    int unread = -1;
    const char *reader = nullptr;
    bool others = false;
    for (const auto &[name, isRead] : extensions) {
        const int source = gltf_json::indexIn(texture.extensions[name], "source", name).value_or(-1);
        if (source < 0)
            continue;
        if (!isRead) {
            unread = unread < 0 ? source : unread;
            material.unreadImage = name;
        } else if (taken < 0) {
            taken = source;
            reader = name;
        } else {
            others |= source != taken;
        }
    }
    if (reader != nullptr && (others || (texture.source >= 0 && texture.source != taken)))
        material.otherImage = reader;
    if (taken >= 0 || texture.source >= 0)
        return taken >= 0 ? taken : texture.source;
    material.unreadImage.clear();
    if (unread >= 0)
        return unread;
    throw GltfUnsupported("texture " + std::to_string(index) + " has no image that is known here");
}

void readTexture(const gltf_json::Model &model, const gltf_json::Material &source, Material &material)
{
    const int index = source.baseColorTexture;
    if (static_cast<size_t>(index) >= model.textures.size())
        throw GltfError("texture " + std::to_string(index) + " does not exist");
    const gltf_json::Texture &texture = model.textures[static_cast<size_t>(index)];
    material.image = imageOf(texture, index, material);
    if (static_cast<size_t>(material.image) >= model.images.size())
        throw GltfError("image " + std::to_string(material.image) + " does not exist");
    readTransform(source, material);
    if (texture.sampler < 0)
        return;
    if (static_cast<size_t>(texture.sampler) >= model.samplers.size())
        throw GltfError("sampler " + std::to_string(texture.sampler) + " does not exist");
    const gltf_json::Sampler &sampler = model.samplers[static_cast<size_t>(texture.sampler)];
    material.wrapU = wrapOf(sampler.wrapS);
    material.wrapV = wrapOf(sampler.wrapT);
    material.filter = sampler.magFilter == gltf_json::kNearest ? Filter::Nearest : Filter::Bilinear;
}

EncodedImage readEncodedFile(const Document &document, const std::string &uri, const std::string &what)
{
    try {
        return {readFileOfUri(document.path(), uri), {}};
    } catch (const GltfUnsupported &error) {
        throw GltfUnsupported(what + ": " + error.what());
    } catch (const GltfError &error) {
        throw GltfError(what + ": " + error.what());
    }
}

// For messages: `image 3 (leaf.png)`.
std::string nameOfImage(const Document &document, int index)
{
    const auto &images = document.model().images;
    const std::string what = "image " + std::to_string(index);
    if (index < 0 || static_cast<size_t>(index) >= images.size())
        throw GltfError(what + " does not exist");
    const std::string &uri = images[static_cast<size_t>(index)].uri;
    return uri.empty() ? what : what + " (" + uri + ")";
}

} // namespace

std::string materialName(const gltf_json::Model &model, size_t material)
{
    const std::string &name = model.materials[material].name;
    return name.empty() ? std::to_string(material) : name;
}

// The conversion of a number out of a float's range is undefined.
static float nearest(double value)
{
    constexpr double kMost = std::numeric_limits<float>::max();
    return static_cast<float>(std::clamp(value, -kMost, kMost));
}

Material readMaterial(const Document &document, int index)
{
    Material material;
    if (index < 0)
        return material;
    return document.named([&] {
        const gltf_json::Model &model = document.model();
        if (static_cast<size_t>(index) >= model.materials.size())
            throw GltfError("material " + std::to_string(index) + " does not exist");
        const gltf_json::Material &source = model.materials[static_cast<size_t>(index)];
        material.name = shownName(materialName(model, static_cast<size_t>(index)));
        if (source.alphaMode == "MASK") {
            material.alphaMode = AlphaMode::Mask;
            material.alphaCutoff = nearest(source.alphaCutoff);
        } else if (source.alphaMode == "BLEND") {
            material.alphaMode = AlphaMode::Blend;
        }
        for (size_t i = 0; i < 4 && i < source.baseColorFactor.size(); ++i)
            material.baseColor[i] = nearest(source.baseColorFactor[i]);
        if (source.baseColorTexture >= 0)
            readTexture(model, source, material);
        return material;
    });
}

EncodedImage readEncodedImage(const Document &document, int index)
{
    return document.named([&]() -> EncodedImage {
        const std::string what = nameOfImage(document, index);
        const gltf_json::Image &image = document.model().images[static_cast<size_t>(index)];
        if (!image.uri.empty())
            return readEncodedFile(document, image.uri, what);
        return {{}, image.bufferView >= 0 ? document.bufferViews().bytes(image.bufferView, what) : image.data};
    });
}

Image decodeImage(const Document &document, int index, const EncodedImage &encoded)
{
    return document.named([&] { return decodeImage(encoded.bytes(), nameOfImage(document, index)); });
}

Image readImage(const Document &document, int index)
{
    return decodeImage(document, index, readEncodedImage(document, index));
}

AlphaTexture alphaTexture(const Material &material, const Image &image, std::shared_ptr<const void> owner)
{
    static const uint8_t full = 255;
    const float factor = material.baseColor[3];
    AlphaTexture texture = material.image < 0 ? AlphaTexture::fromUnorm8(1, 1, &full, 1, 1, factor)
                           : image.alpha16.empty()
                               ? AlphaTexture::fromUnorm8(image.width, image.height, image.rgba.data() + 3, 4,
                                                          size_t{4} * image.width, factor, std::move(owner))
                               : AlphaTexture::fromUnorm16(image.width, image.height, image.alpha16.data(), 1, factor);
    texture.wrapU = material.wrapU;
    texture.wrapV = material.wrapV;
    texture.filter = material.filter;
    return texture;
}

std::string blendCaution(double cutoff, const std::string &done)
{
    std::array<char, 32> digits{};
    std::snprintf(digits.data(), digits.size(), "%.9g", cutoff);
    return "its alphaMode is BLEND, and was " + done + " as a mask with the cutoff " + digits.data() +
           ", which is wrong for renderers that blend or dither";
}

std::optional<State> onlyOutcome(const Material &material, double cutoff)
{
    const double factor = material.baseColor[3];
    if (std::min(0.0, factor) >= cutoff)
        return State::Opaque;
    if (std::max(0.0, factor) < cutoff)
        return State::Transparent;
    return std::nullopt;
}

} // namespace vellum
