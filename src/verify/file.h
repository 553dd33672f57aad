// SPDX-License-Identifier: Apache-2.0
// Verification of a glTF file: the structure of its micromaps, and their states for each primitive.
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
    // The cutoff for alphaMode BLEND, instead of StoredMicromaps::blendCutoff. Without one, opaque means an alpha of 1,
    // and transparent one of 0. Masks have the cutoff of their material.
    std::optional<float> blendCutoff;
    // The most work for a file, in addition to workForByte: a small file that shares data between many triangles could
    // take hours. About a minute; the rest is not verified.
    uint64_t fileWork = uint64_t{1} << 29;
    uint64_t workForByte = 256; // of micromap data: 64 for each micro-triangle of 4-state data
    // Most findings of structure that are listed.
    size_t maxStructureFindings = 100;
};

struct PrimitiveReport {
    PrimitivePlace place;
    std::string name; // `mesh 2 "leaves" primitive 0`
    std::string material;
    std::optional<float> cutoff; // none: alphaMode BLEND
    size_t triangles = 0;
    size_t special = 0; // triangles with a special index
    // Why its alpha can differ from the one that was verified; empty if it cannot.
    std::string caution;
    Result result;
};

// A primitive whose claims cannot be checked.
struct Unverified {
    PrimitivePlace place;
    std::string name;
    std::string reason; // "image 3 is not a PNG or JPEG"
};

struct FileReport {
    StoredMicromaps stored; // its extension is empty if the file has no micromaps
    // Findings about the structure. If there are any, claims are not verified.
    std::vector<MicromapFinding> findings;
    std::vector<PrimitiveReport> primitives; // in the file's order
    std::vector<Unverified> unverified;
    // The levels that a device must support for it: maxOpacity2StateSubdivisionLevel and
    // maxOpacity4StateSubdivisionLevel. -1 if no data has that format.
    int level2State = -1;
    int level4State = -1;
    // A primitive has special and other indices, so a pipeline must not be created with
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR.
    bool mixedSpecialIndices = false;
    uint64_t work = 0; // the sum of Result::work

    [[nodiscard]] Counts counts() const;
};

// Throws GltfError for a file that cannot be read.
FileReport verifyDocument(const Document &document, const FileOptions &options);

} // namespace vellum::verify
