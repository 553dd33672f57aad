// Verification of a glTF file: the structure of its micromaps, and what they say of each primitive.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "gltf/document.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "verify/verify.h"

namespace vellum::verify
{

struct FileOptions : Options {
    // The cutoff is the material's. alphaMode BLEND has none: opaque is what has an alpha of 1, and transparent what
    // has one of 0, unless this is to be its cutoff.
    std::optional<double> blendCutoff;
    // The most work for a file, beside what the size of its micromaps is worth: a small file that says one thing of
    // many triangles could take hours. About a minute; what is left then is not verified.
    uint64_t fileWork = uint64_t{1} << 29;
    uint64_t workForByte = 256; // of micromap data: 64 for each micro-triangle of 4-state data
    // Most offences of structure that are listed.
    size_t maxOffences = 100;
};

struct PrimitiveReport {
    PrimitivePlace place;
    std::string name; // `mesh 2 "leaves" primitive 0`
    std::string material;
    std::optional<double> cutoff; // none: alphaMode BLEND
    size_t triangles = 0;
    size_t special = 0; // triangles with a special index
    // Why its alpha can become another than the one that was verified; empty where it cannot.
    std::string caution;
    Result result;
};

// A primitive whose claims cannot be checked.
struct Unverified {
    PrimitivePlace place;
    std::string name;
    std::string reason; // "image 3 is no PNG or JPEG"
};

struct FileReport {
    std::string extension; // empty: the file has no micromaps
    size_t micromaps = 0;
    // Where there are any, claims are not looked at.
    std::vector<MicromapOffence> offences;
    std::vector<PrimitiveReport> primitives; // in the file's order
    std::vector<Unverified> unverified;
    // The levels that a device must have for it: maxOpacity2StateSubdivisionLevel and maxOpacity4StateSubdivisionLevel.
    // Below 0 where there are none.
    int level2State = -1;
    int level4State = -1;
    // Special indices stand beside others in a primitive, so that a pipeline must not be created with
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR.
    bool mixedSpecialIndices = false;
    uint64_t work = 0; // that was done, as of Result

    [[nodiscard]] Counts counts() const;
};

// Throws GltfError for a file that cannot be read.
FileReport verifyDocument(const Document &document, const FileOptions &options);

} // namespace vellum::verify
