// SPDX-License-Identifier: Apache-2.0
// The parts of a file that alpha testing needs: triangles with the texture coordinates that their material's base
// colour texture is read at, materials, and images.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "gltf/data/image.h"
#include "gltf/document.h"

namespace vellum
{

using Vec3 = std::array<float, 3>;

enum class AlphaMode : uint8_t { Opaque, Mask, Blend };

struct Material {
    std::string name; // shownName() of materialName()
    AlphaMode alphaMode = AlphaMode::Opaque;
    float alphaCutoff = 0.5f;                   // 0.5 for AlphaMode::Blend
    std::array<float, 4> baseColor{1, 1, 1, 1}; // linear factor of the texture
    int image = -1;                             // images[] of the file; -1 without a texture, which reads as 1
    int uvSet = 0;                              // the n of TEXCOORD_n
    // KHR_texture_transform: (u, v) becomes (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]).
    std::array<double, 6> uvTransform{1, 0, 0, 0, 1, 0};
    Wrap wrapU = Wrap::Repeat;
    Wrap wrapV = Wrap::Repeat;
    Filter filter = Filter::Bilinear; // magFilter: what mip level 0 is read with

    // Alpha-tested: alphaMode MASK, or BLEND, which is treated as a mask.
    // The texture also has another image: by an extension that is not supported here ("KHR_texture_basisu"), or for
    // readers that do not support one that is used here ("EXT_texture_webp"). Empty if all readers use the same
    // image.
    std::string unreadImage;
    std::string otherImage;

    [[nodiscard]] bool masked() const { return alphaMode != AlphaMode::Opaque; }
};

// alphaMode BLEND without a cutoff: opaque from 1 on, and transparent below 2^-52, which of a texture's values only 0
// is. As a cutoff, and a distance within which values are neither.
constexpr double kBlendCutoff = 0.5 + 0x1p-53;
constexpr double kBlendBand = 0.5 - 0x1p-53;
// The most vertex alphas with which triangles of one micromap are baked: each needs a map of the texture's cells of its
// own. Triangles with others, the rarest, stay unknown.
constexpr size_t kMostVertexAlphas = 16;
// States for which alpha a cutoff is not exact; `done` is what was done with the primitive.
std::string blendCaution(double cutoff, const std::string &done);

struct Primitive {
    int material = -1; // materials[] of the file; -1: glTF's default material, which is opaque
    // One for each vertex, or empty if the file has none. In the space of the mesh.
    std::vector<Vec3> positions;
    // Coordinates for the material's base colour texture, uvTransform applied; one for each vertex; none where the
    // material has no texture or the primitive no such set.
    std::vector<TexCoord> uvs;
    // Renderers apply uvTransform in single precision, with errors that are relative to the terms that are added up,
    // and those may cancel out. No sum of the absolute terms of a vertex is larger than this power of two; 0 without
    // a transform.
    float uvTerms = 0;
    // COLOR_0's alpha, which the texture's is multiplied with; none where it is 1 all over.
    std::vector<float> alphas;
    // Three for each triangle, all below the number of vertices; strips and fans are unfolded into triangles in the
    // order and with the winding that glTF gives them.
    std::vector<uint32_t> indices;
    // A morph target changes `uvs` or `alphas`, which are those of no morphing at all: a micromap of them would be
    // wrong as soon as it is animated.
    bool morphed = false;
    // There is uncompressed data for readers that do not know its compression, in which triangles have another order,
    // or their corners, or other values: one micromap cannot be right for both.
    bool twofold = false;

    [[nodiscard]] size_t triangleCount() const { return indices.size() / 3; }
};

// Every primitive made of triangles (lists, strips, fans), in the file's order, used by a node or not.
std::vector<PrimitivePlace> trianglePrimitives(const Document &document);
bool isMadeOfTriangles(const Document &document, PrimitivePlace place);

// All of these throw GltfError for what does not exist, contradicts itself or reaches outside of its buffer, and
// GltfUnsupported for what cannot be decoded here. Messages name the file and the place in it.

// -1 gives the default material.
Material readMaterial(const Document &document, int material);
// The name of a material that exists, as it stands in the file, or its number.
std::string materialName(const gltf_json::Model &model, size_t material);

// glTF leaves it open what a primitive without positions is: it is read for its texture coordinates with Skip, and is
// GltfUnsupported with Read.
enum class Positions : uint8_t { Read, Skip };
Primitive readPrimitive(const Document &document, PrimitivePlace place, Positions positions);

// `components` floats for each vertex of any attribute, also one that is compressed with the mesh.
std::vector<float> readAttribute(const Document &document, PrimitivePlace place, const std::string &name,
                                 uint32_t components);

// An image's bytes as they are stored.
struct EncodedImage {
    std::vector<uint8_t> ofFile;       // read from a file of its own
    std::span<const uint8_t> inMemory; // else: of the document
    [[nodiscard]] std::span<const uint8_t> bytes() const { return ofFile.empty() ? inMemory : ofFile; }
};
EncodedImage readEncodedImage(const Document &document, int image);

Image decodeImage(const Document &document, int image, const EncodedImage &encoded);
// Reads and decodes it.
Image readImage(const Document &document, int image);

// The alpha of a material's texture as its sampler reads it, times the base colour factor's; one texel of that factor
// if there is no texture. `image` is the result of readImage for material.image, unread without a texture. Its texels
// are not copied: `owner` keeps them, or is null where the image outlives the texture.
AlphaTexture alphaTexture(const Material &material, const Image &image, std::shared_ptr<const void> owner = {});
AlphaTexture alphaTexture(const Material &material, const Image &&image, std::shared_ptr<const void> = {}) = delete;

// Opaque or Transparent where an alpha test with this cutoff has but one outcome, whatever the texture says and however
// it is filtered: it has values from 0 to 1, times the base colour factor's alpha and that of vertices, from 0 to 1.
std::optional<State> onlyOutcome(const Material &material, double cutoff);

// The corners' coordinates for each triangle. All zero where the primitive has none.
std::vector<TriangleUvs> triangleUvs(const Primitive &primitive);

} // namespace vellum
