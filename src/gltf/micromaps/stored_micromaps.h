// The micromaps that a glTF file has by EXT_mesh_opacity_micromap, or by its earlier spelling
// KHR_mesh_opacity_micromap.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/micromap.h"
#include "gltf/document.h"

namespace vellum
{

// An element of the root's `micromaps`.
struct StoredMicromap {
    std::vector<MicromapTriangle> triangles;
    std::vector<uint8_t> data;
    std::vector<MicromapUsage> usage; // as the file has it
};

// What a primitive says of its triangles.
struct PrimitiveMicromap {
    uint32_t micromap = 0;        // into StoredMicromaps::micromaps
    std::vector<int32_t> indices; // one for each triangle: a micromap triangle less baseTriangle, or a special index
    uint32_t baseTriangle = 0;
};

struct StoredMicromaps {
    std::string extension; // the spelling that the file has; empty where it has none
    std::vector<StoredMicromap> micromaps;
    std::map<PrimitivePlace, PrimitiveMicromap> primitives;

    // The micromap of one primitive as a model of its own, with only the triangles and data that it uses; nothing
    // where it has none. Valid by Micromap::validate().
    [[nodiscard]] std::optional<Micromap> of(PrimitivePlace place) const;
};

// Something in a file that breaks a rule of the extension.
struct MicromapOffence {
    std::string place;   // `micromaps[0]` or `mesh 2 "leaves" primitive 0`
    std::string message; // "usageCounts add up to 12 triangles, there are 10"
};

// What happened to a file that a program has written which keeps extensions that it does not know, and drops the buffer
// views that only they refer to (gltf-pipeline); in one line. Nothing where that did not happen.
std::optional<std::string> lossOfMicromaps(const Document &document);

// Every offence, at most `most` of them. What is wrong beside the extension (a buffer view that reaches outside of its
// buffer) is among them where the extension depends on it.
std::vector<MicromapOffence> findMicromapOffences(const Document &document, size_t most = 100);

// Reads and checks them: levels, formats, data in bounds, usage counts, indices. Nothing that is returned can lead a
// reader astray, whatever is in the file. Throws GltfError for the first offence.
StoredMicromaps readMicromaps(const Document &document);

} // namespace vellum
