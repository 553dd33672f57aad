// SPDX-License-Identifier: Apache-2.0
// A file with micromaps as both outputs of `vellum inspect` need it, and which of its triangles are inspected.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/curve.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/known_surface.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/primitive.h"

namespace vellum::inspect
{

// Numbers from `first` to `last`, both included.
struct NumberRange {
    uint32_t first = 0;
    uint32_t last = 0;
};

// "7", "3-9" or several with commas. Throws UsageError, which names `option`.
std::vector<NumberRange> parseRanges(const std::string &text, const std::string &option);

// Returns whether `ranges` have `number`; no ranges have every number.
bool contains(const std::vector<NumberRange> &ranges, uint32_t number);

// A triangle is chosen if it is in all of these. Empty ones choose everything.
struct Selection {
    std::vector<NumberRange> meshes;
    std::vector<NumberRange> primitives; // of each mesh
    std::vector<NumberRange> triangles;  // of each primitive
    std::vector<std::string> materials;  // names or numbers

    // Returns whether the material is chosen.
    [[nodiscard]] bool hasMaterial(int index, std::string_view name) const;
    [[nodiscard]] bool everything() const;
};

// A triangle of a micromap.
struct InspectedRecord {
    uint32_t micromap = 0; // into StoredMicromaps::micromaps
    MicromapTriangle triangle;
    StateCounts states{};
};

struct InspectedMaterial {
    int index = -1; // materials[] of the file
    Material material;
    std::optional<float> cutoff;        // of the alpha test: of alphaMode MASK, and of BLEND that was baked as a mask
    std::shared_ptr<const Image> image; // null if there is none or it cannot be read
    std::string problem;                // why it cannot be read
};

struct InspectedPrimitive {
    PrimitivePlace place;
    std::string mesh;     // the mesh's name; empty without
    uint32_t material;    // into InspectedFile::materials
    size_t triangles = 0; // triangles of the primitive
    // For each chosen triangle: its number, its coordinates, and the target of its micromap index: an element of
    // InspectedFile::records or a special index.
    std::vector<uint32_t> numbers;
    std::vector<TriangleUvs> uvs;
    std::vector<int32_t> records;
    uint64_t indexBytes = 0; // of the micromap indices in the file
};

// The surface of an alpha-tested primitive in the scene, or of one with a micromap.
struct InspectedSurface {
    PrimitivePlace place;
    std::string mesh; // names; empty without
    std::string material;
    int materialIndex = -1;
    double area = 0;  // in the world, of all instances
    double known = 0; // the part of it that is opaque or transparent
};

struct InspectedFile {
    std::string name;
    uint64_t bytes = 0;                    // with those of the files that it names
    bool baked = false;                    // the micromaps were baked in memory
    std::vector<SkippedPrimitive> skipped; // by the bake
    std::optional<SurfaceShares> surface;
    std::vector<InspectedSurface> surfaces; // whatever is chosen
    StoredMicromaps stored;
    std::vector<InspectedMaterial> materials;
    std::vector<InspectedPrimitive> primitives; // primitives with micromaps and chosen triangles, sorted by place
    std::vector<InspectedRecord> records;
    size_t meshCount = 0;
    size_t primitiveCount = 0; // made of triangles, with and without micromaps
};

// With `bake`, ignores the micromaps of the file and bakes it. Throws GltfError, BakeError, or Error if nothing is left
// to inspect.
InspectedFile inspectFile(const Document &document, const Selection &selection, const DocumentBakeOptions *bake);

// Returns whether it is a special index.
inline bool isSpecial(int32_t record)
{
    return record < 0;
}

// The states of `record`, of InspectedFile::records or a special index, at barycentrics (u, v).
class StatesOf
{
public:
    StatesOf(const InspectedFile &file, int32_t record)
    {
        if (isSpecial(record)) {
            special_ = *specialState(record);
            return;
        }
        const InspectedRecord &of = file.records[static_cast<size_t>(record)];
        triangle_ = of.triangle;
        data_ = file.stored.micromaps[of.micromap].data.data() + of.triangle.dataOffset;
    }

    [[nodiscard]] State at(double u, double v) const
    {
        if (data_ == nullptr)
            return special_;
        const uint32_t index =
            shared::curveIndex(static_cast<float>(u), static_cast<float>(v), triangle_.subdivisionLevel);
        return readState(data_, index, triangle_.format);
    }
    [[nodiscard]] uint32_t level() const { return data_ == nullptr ? 0 : triangle_.subdivisionLevel; }

private:
    const uint8_t *data_ = nullptr;
    MicromapTriangle triangle_;
    State special_ = State::Transparent;
};

// The contents of an inspected file, in numbers.
struct Tally {
    uint64_t triangles = 0;
    std::array<std::array<uint64_t, 2>, 13> levels{}; // triangles by level; of 2-state, of 4-state data
    std::array<uint64_t, 4> special{};                // triangles by the State of their special index
    std::array<double, 4> states{};                   // share of all triangles' area by State, in sum 1
    std::array<double, 4> uvArea{};                   // by State, in squares of the unit of UVs
    uint64_t recordsUsed = 0;                         // micromap triangles that a chosen triangle refers to
    uint64_t dataBytes = 0;                           // of those micromap triangles' data
    uint64_t indexBytes = 0;
};

// The tally of the chosen triangles.
Tally tallyOf(const InspectedFile &file);
// The tally of one primitive's triangles.
Tally tallyOf(const InspectedFile &file, const InspectedPrimitive &primitive);

// The tally of those primitives' triangles.
Tally tallyOf(const InspectedFile &file, std::span<const InspectedPrimitive *const> primitives);

// The tally of the triangles of each of InspectedFile::materials.
std::vector<Tally> talliesOfMaterials(const InspectedFile &file);

// Share of each State; for a special index 1 for its own.
std::array<double, 4> stateShares(const InspectedFile &file, int32_t record);
// 0 for a special index.
uint64_t dataBytes(const InspectedFile &file, int32_t record);
// In squares of the unit of UVs; 0 if it is not a finite number.
double uvArea(const TriangleUvs &uvs);

} // namespace vellum::inspect
