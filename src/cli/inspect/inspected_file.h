// SPDX-License-Identifier: Apache-2.0
// A file with micromaps as both outputs of `vellum inspect` need it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/inspect/selection.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/known_surface.h"
#include "gltf/micromaps/state_counter.h"
#include "gltf/primitive.h"

namespace vellum::cli
{

// A triangle of a micromap.
struct InspectedRecord {
    uint32_t micromap = 0; // into StoredMicromaps::micromaps
    MicromapTriangle triangle;
    StateCounts states{};
};

struct InspectedMaterial {
    int index = -1; // materials[] of the file
    Material material;
    std::shared_ptr<const Image> image; // null where there is none or it cannot be read
    std::string problem;                // why it cannot be read
};

struct InspectedPrimitive {
    PrimitivePlace place;
    std::string mesh;     // the mesh's name; empty without
    uint32_t material;    // into InspectedFile::materials
    size_t triangles = 0; // that the primitive has
    // Of the chosen triangles: which they are, their coordinates, and what their micromap index leads to: an element of
    // InspectedFile::records or a special index.
    std::vector<uint32_t> numbers;
    std::vector<TriangleUvs> uvs;
    std::vector<int32_t> records;
    uint64_t indexBytes = 0; // of the micromap indices in the file
};

struct InspectedFile {
    std::string name;
    uint64_t bytes = 0;                    // with those of the files that it names
    bool baked = false;                    // the micromaps were baked in memory
    std::vector<SkippedPrimitive> skipped; // by the bake
    std::optional<SurfaceShares> surface;
    StoredMicromaps stored;
    std::vector<InspectedMaterial> materials;
    std::vector<InspectedPrimitive> primitives; // those with micromaps and chosen triangles, sorted by place
    std::vector<InspectedRecord> records;
    size_t meshCount = 0;
    size_t primitiveCount = 0; // made of triangles, with and without micromaps
};

// With `bake`, leaves aside what the file has and bakes it. Throws GltfError, BakeError, or Error where nothing is left
// to look at.
InspectedFile inspectFile(const Document &document, const Selection &selection, const DocumentBakeOptions *bake);

// What is drawn at a triangle.
inline bool isSpecial(int32_t record)
{
    return record < 0;
}

} // namespace vellum::cli
