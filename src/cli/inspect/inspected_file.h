// A file with micromaps as both outputs of `vellum inspect` need it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "cli/inspect/selection.h"
#include "cli/inspect/state_counter.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/primitive.h"

namespace vellum::cli
{

// A triangle of a micromap.
struct InspectedRecord {
    std::uint32_t micromap = 0; // into StoredMicromaps::micromaps
    MicromapTriangle triangle;
    StateCounts states{};
};

struct InspectedMaterial {
    int index = -1; // materials[] of the file
    Material material;
    Image image;         // empty where there is none or it cannot be read
    std::string problem; // why it cannot be read
};

struct InspectedPrimitive {
    PrimitivePlace place;
    std::string mesh;          // the mesh's name; empty without
    std::uint32_t material;    // into InspectedFile::materials
    std::size_t triangles = 0; // that the primitive has
    // Of the chosen triangles: which they are, their coordinates, and what their micromap index leads to: an element of
    // InspectedFile::records or a special index.
    std::vector<std::uint32_t> numbers;
    std::vector<TriangleUvs> uvs;
    std::vector<std::int32_t> records;
    std::uint64_t indexBytes = 0; // of the micromap indices in the file
};

struct InspectedFile {
    std::string name;
    std::uint64_t bytes = 0;
    bool baked = false; // the micromaps were made just now
    StoredMicromaps stored;
    std::vector<InspectedMaterial> materials;
    std::vector<InspectedPrimitive> primitives; // those with micromaps and chosen triangles, sorted by place
    std::vector<InspectedRecord> records;
    std::size_t meshCount = 0;
    std::size_t primitiveCount = 0; // made of triangles, with and without micromaps
};

// What is done with a file without micromaps, and with masked primitives without.
enum class Missing : std::uint8_t { Refuse, Bake };

// Missing::Bake leaves aside what the file has and bakes every masked primitive with the baker's defaults. Throws
// GltfError, BakeError, or Error where nothing is left to look at.
InspectedFile inspectFile(const Document &document, const Selection &selection, Missing missing);

// What is drawn at a triangle.
inline bool isSpecial(std::int32_t record)
{
    return record < 0;
}

} // namespace vellum::cli
