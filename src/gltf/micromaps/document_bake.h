// SPDX-License-Identifier: Apache-2.0
// Bakes the micromaps of a glTF file: which primitives get one, and what is in it. Writes nothing.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "bake/outline.h"
#include "gltf/alpha_textures.h"
#include "gltf/document.h"
#include "gltf/micromaps/bake_cache.h"
#include "gltf/micromaps/known_surface.h"
#include "gltf/micromaps/stored_micromaps.h"

namespace vellum
{

// Less than DocumentBakeOptions::targetKnown can be known.
class TargetNotReached : public BakeError
{
public:
    using BakeError::BakeError;
};

struct DocumentBakeOptions {
    // The cutoff is the material's; a budget is for all of the file. Not leastKnown.
    BakeOptions bake;
    // The smallest micromaps that decide this share of the alpha-tested surface (0 to 1). bakeDocument() throws
    // TargetNotReached, with the share that can be decided, where that is less.
    std::optional<double> targetKnown;
    // Also bakes alphaMode BLEND: opaque only where alpha is 1, and transparent only where it is 0. This is correct for
    // renderers that blend, and for those that dither.
    bool blend = false;
    // Bakes it as a mask with this cutoff instead, which is right only for renderers that treat it as one.
    std::optional<float> blendCutoff;
    // For textures that have an image of an unsupported kind (KTX2, DDS) and another one, bakes from the latter.
    bool fallbackImages = false;
    // Primitives whose material or mesh has such a name (shell patterns: * ? [...]) are not baked.
    std::vector<std::string> excludedMaterials;
    std::vector<std::string> excludedMeshes;
    // Images that the files of one run share; may be null.
    DecodedImages *images = nullptr;
    // Results of earlier bakes. Those of textures whose images cannot be read are not kept.
    BakeCache cache;
};

struct BakedPrimitive {
    PrimitivePlace place;
    std::string name; // `mesh 2 "leaves" primitive 0`
    std::string material;
    PrimitiveMicromap micromap;
    // The corners of its triangles, for a strip or a fan: the extension is for lists only. Empty for a list.
    std::vector<uint32_t> corners;
    // Triangles that are unknown because their vertices have different alphas (COLOR_0).
    size_t varying = 0;
    // Renderers for which it is wrong, or a cutoff with which its texture has no effect; empty if none.
    std::string caution;
};

enum class SkipReason : uint8_t {
    AlphaModeBlend,       // and DocumentBakeOptions::blend is off
    Excluded,             // by the options
    AlphaChanges,         // ChangingAlpha, or morph targets
    CompressedStrip,      // KHR_draco_mesh_compression without an index buffer to replace
    NoTriangles,          // or no positions to count them by
    NoTextureCoordinates, // of the set that the texture uses
    AmbiguousTriangles,   // compressed and uncompressed data differ
    UnsupportedImage,     // of the material
    Unsupported,          // anything else that cannot be read
};
// "alphaModeBlend" and so on.
const char *nameOf(SkipReason reason);

// An alpha-tested primitive without a micromap.
struct SkippedPrimitive {
    PrimitivePlace place;
    std::string name; // `mesh 2 "leaves" primitive 0`
    std::string material;
    SkipReason code = SkipReason::Unsupported;
    std::string reason;       // "it has no texture coordinates (TEXCOORD_1)"
    bool hadMicromap = false; // it is removed: all micromaps of a file are replaced together
    bool hasFallback = false; // DocumentBakeOptions::fallbackImages would bake it

    // The file has something that is not supported. Otherwise the primitive is not one to be baked.
    [[nodiscard]] bool unsupported() const
    {
        return code == SkipReason::UnsupportedImage || code == SkipReason::Unsupported;
    }
};

struct DocumentBake {
    // One for all primitives whose alpha is read with the same parameters, so that equal triangles share. None is
    // empty: if all triangles are special indices there is one triangle that nothing refers to, as the extension
    // requires at least one.
    std::vector<StoredMicromap> micromaps;
    std::vector<BakedPrimitive> primitives; // in the file's order
    std::vector<SkippedPrimitive> skipped;
    std::optional<float> blendCutoff; // of the options, if a primitive was baked with it
    // With a cache: results that were there, and those that were baked. There is one for each micromap, or with a
    // budget, which is shared over all of them, one for the file.
    size_t cacheHits = 0;
    size_t cacheMisses = 0;
};

// Bakes every alpha-tested primitive, whether a node uses it or not. The result does not depend on the number of
// threads. Primitives that cannot be baked (GltfUnsupported) are skipped; throws GltfError for a damaged file,
// BakeError.
// `areas`: those of the document, if they were measured before.
DocumentBake bakeDocument(const Document &document, const DocumentBakeOptions &options,
                          const SurfaceAreas *areas = nullptr);

// What a bake with a setting would be.
struct DocumentOutline {
    BakeSetting setting;
    uint64_t bytes = 0;                // of all StoredMicromaps
    bool tooLarge = false;             // the bake would throw BakeTooLarge
    std::array<uint64_t, 13> levels{}; // triangles with data by level
    double known = 0;                  // share of the alpha-tested surface that is opaque or transparent
    double proven = 0;                 // less than that with 2 states: the rest of it is an approximation
};

struct OutlinedPrimitive {
    PrimitivePlace place;
    std::string name; // `mesh 2 "leaves" primitive 0`
    std::string material;
    size_t triangles = 0;
};

struct DocumentOutlines {
    std::vector<DocumentOutline> outlines;     // as outlineBakes() returns them; none where no primitive is baked
    std::vector<OutlinedPrimitive> primitives; // those that are baked, in the file's order
    std::vector<SkippedPrimitive> skipped;
    double withoutMicromap = 0; // share of the alpha-tested surface
    bool measured = true;       // false: without a scene to measure, all triangles that are baked count alike
};

// Every texture is read once for all of them.
DocumentOutlines outlineDocument(const Document &document, const DocumentBakeOptions &options,
                                 std::span<const std::optional<uint32_t>> levels, std::span<const uint64_t> budgets);

// The bake as the reader of a file with it returns it, without the name of an extension.
StoredMicromaps storedOf(DocumentBake bake);

} // namespace vellum
