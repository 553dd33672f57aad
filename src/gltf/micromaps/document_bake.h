// Bakes the micromaps of a glTF file: which primitives get one, and what is in it. Writes nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "gltf/document.h"
#include "gltf/micromaps/stored_micromaps.h"

namespace vellum
{

struct DocumentBakeOptions {
    // The cutoff is the material's; a budget is for all of the file.
    BakeOptions bake;
    // Bakes alphaMode BLEND, too: opaque only where alpha is 1, and transparent only where it is 0. That is true of
    // renderers that blend, and of those that dither.
    bool blend = false;
    // Bakes it as a mask with this cutoff instead: true only of renderers that treat it as one.
    std::optional<float> blendCutoff;
    // Bakes primitives whose texture has an image of a kind that is not read here (KTX2, AVIF, DDS) and another for
    // those who do not read it either, from the latter.
    bool fallbackImages = false;
    // Materials and meshes with such a name (shell patterns: * ? [...]) are left as they are.
    std::vector<std::string> leaveMaterials;
    std::vector<std::string> leaveMeshes;
};

struct BakedPrimitive {
    PrimitivePlace place;
    std::string material;
    PrimitiveMicromap micromap;
    // The corners of its triangles, for a strip or a fan: the extension is for lists only. Empty for a list.
    std::vector<uint32_t> corners;
    // Triangles that are unknown because their vertices have different alphas (COLOR_0).
    size_t varying = 0;
    std::string caution; // of which renderers it is not true; empty where it is true of all
};

// An alpha-tested primitive without a micromap.
struct LeftPrimitive {
    PrimitivePlace place;
    std::string material;
    std::string reason;       // "it has no texture coordinates (TEXCOORD_1)"
    bool hadMicromap = false; // which goes: those of a file are replaced all together
    bool unreadable = false;  // something in the file is not supported; otherwise it is no primitive to be baked
};

struct DocumentBake {
    // One for all primitives whose alpha is read the same way, so that equal triangles share. None is empty: where all
    // triangles are special indices there is one triangle that nothing refers to, as the extension wants at least one.
    std::vector<StoredMicromap> micromaps;
    std::vector<BakedPrimitive> primitives; // in the file's order
    std::vector<LeftPrimitive> left;
};

// Bakes every alpha-tested primitive, whether a node uses it or not. The result does not depend on the number of
// threads. Primitives that cannot be baked (GltfUnsupported) are left; throws GltfError for a damaged file, BakeError.
DocumentBake bakeDocument(const Document &document, const DocumentBakeOptions &options);

} // namespace vellum
