// SPDX-License-Identifier: Apache-2.0
// The micromaps of a glTF file: EXT_mesh_opacity_micromap, or its earlier name KHR_mesh_opacity_micromap.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bake/packed.h"
#include "core/micromap.h"
#include "gltf/document.h"

namespace vellum
{

inline constexpr const char *kMicromapExtension = "EXT_mesh_opacity_micromap";
inline constexpr std::array kMicromapExtensions = {kMicromapExtension, "KHR_mesh_opacity_micromap"};
// The extension is a draft. This is the text that is implemented here.
inline constexpr const char *kMicromapDraft = "draft of 2026, glTF pull request 2623, revision 1ac6c757";

// Returns whether an object's "extensions" have one of them.
bool hasMicromapExtension(const JsonValue &extensions);

// Bytes of the smallest index of glTF for a micromap with this many triangles: 1, 2 or 4. The four highest values of
// each type are special.
constexpr size_t micromapIndexBytes(size_t triangles)
{
    return triangles <= 0xfc ? 1 : triangles <= 0xfffc ? 2 : 4;
}

// An element of the root's `micromaps`.
struct StoredMicromap {
    std::vector<MicromapTriangle> triangles;
    std::vector<uint8_t> data;
    std::vector<MicromapUsage> usage; // as in the file

    // The size of the data and of the triangles' records.
    [[nodiscard]] size_t bytes() const { return data.size() + sizeof(MicromapTriangle) * triangles.size(); }
    // All of it has 2 states: so have triangles with special indices, which are as approximate.
    [[nodiscard]] bool isApproximate() const;
};

// A primitive's use of a micromap.
struct PrimitiveMicromap {
    uint32_t micromap = 0;        // into StoredMicromaps::micromaps
    std::vector<int32_t> indices; // one for each triangle: a micromap triangle less baseTriangle, or a special index
    uint32_t baseTriangle = 0;
};

struct StoredMicromaps {
    std::string extension; // the spelling that the file has; empty where it has none
    std::vector<StoredMicromap> micromaps;
    std::map<PrimitivePlace, PrimitiveMicromap> primitives;
    // The cutoff with which alphaMode BLEND was baked as a mask, as `vellum bake` notes it; otherwise nothing.
    std::optional<float> blendCutoff;

    // The micromap of one primitive as a model of its own, with only the triangles and data that it uses; nothing
    // where it has none. Valid by Micromap::validate().
    [[nodiscard]] std::optional<Micromap> of(PrimitivePlace place) const;
};

// StoredMicromaps::blendCutoff of the file with this JSON.
std::optional<float> blendCutoffOf(const JsonValue &root);

// Something in a file that breaks a rule of the extension.
struct MicromapFinding {
    std::string place;   // `micromaps[0]` or `mesh 2 "leaves" primitive 0`
    std::string message; // "usageCounts add up to 12 triangles, there are 10"
};

// Describes, in one line, the loss in a file written by a program that keeps extensions that it does not know, and
// drops the buffer views that only they refer to (gltf-pipeline). Nothing where that did not happen.
std::optional<std::string> lossOfMicromaps(const Document &document);

struct CheckedMicromaps {
    StoredMicromaps stored; // incomplete if there are findings
    std::vector<MicromapFinding> findings;
};

// Reads the micromaps and checks levels, formats, data ranges, usage counts and indices. Lists at most `most` findings,
// including faults outside of the extension that it depends on, such as a buffer view outside of its buffer.
CheckedMicromaps checkMicromaps(const Document &document, size_t most = 100);

// Reads micromaps that must be valid: throws GltfError for the first finding.
StoredMicromaps readMicromaps(const Document &document);

// Counts the states in ranges of micro-triangles in constant time. Keeps sums over blocks of the data, so that every
// count costs the same. All triangles of an untrusted file may refer to the same large data; counting each
// micro-triangle on its own could then take hours.
class StateCounter
{
public:
    // `data` must outlive this.
    explicit StateCounter(std::span<const uint8_t> data);

    // Counts `count` micro-triangles from `first` on in the triangle's data, which must be inside of the data.
    [[nodiscard]] StateCounts count(const MicromapTriangle &triangle, uint64_t first, uint64_t count) const;
    // Counts all micro-triangles of a triangle.
    [[nodiscard]] StateCounts count(const MicromapTriangle &triangle) const
    {
        return count(triangle, 0, microTriangleCount(triangle.subdivisionLevel));
    }

private:
    // Counts the data before that position, in micro-triangles of the format from the first byte on.
    [[nodiscard]] StateCounts before(uint64_t position, Format format) const;

    std::span<const uint8_t> data_;
    std::vector<StateCounts> four_; // before each block, as 4-state data
    std::vector<uint64_t> two_;     // opaque ones before each block, as 2-state data
};

} // namespace vellum
