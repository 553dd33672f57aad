// SPDX-License-Identifier: Apache-2.0
// The micromap model: what an application hands to a micromap build and to the geometry that uses it, as plain data.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/opacity.h"

namespace vellum
{

// VkOpacityMicromapFormatEXT
enum class Format : uint16_t { TwoState = 1, FourState = 2 };

// Micromap states; the numbers are those of 4-state data.
enum class State : uint8_t {
    Transparent = shared::kStateTransparent,
    Opaque = shared::kStateOpaque,
    UnknownTransparent = shared::kStateUnknownTransparent,
    UnknownOpaque = shared::kStateUnknownOpaque,
};

// VkOpacityMicromapSpecialIndexEXT for a triangle that is one state all over.
constexpr int32_t specialIndex(State state)
{
    return ~static_cast<int32_t>(state);
}

// The state a special index stands for; nothing for an ordinary index or a value below -4.
constexpr std::optional<State> specialState(int32_t index)
{
    if (index >= 0 || index < -4)
        return std::nullopt;
    return static_cast<State>(~index);
}

// Number of micro-triangles at a subdivision level (0..12): 4^level.
constexpr uint32_t microTriangleCount(uint32_t level)
{
    return 1u << (2 * level);
}

// Bytes of packed states of one triangle: one or two bits each, least significant bit first, rounded up to bytes.
constexpr uint32_t packedBytes(uint32_t level, Format format)
{
    const uint32_t bits = microTriangleCount(level) * (format == Format::TwoState ? 1u : 2u);
    return (bits + 7) / 8;
}

// By this factor the micro-triangles of an automatic level may be larger than squares of the length asked for. Cards
// over whole textures, whose sizes are powers of two or small multiples of them, are then far from where a level ends:
// rounded coordinates (quantization) do not raise it. Exact in single precision.
inline constexpr float kLevelSlack = 23.0f / 16;

// Reads state `index` (0..4^level - 1) of packed data. A 2-state bit reads as Transparent or Opaque.
State readState(const uint8_t *data, uint32_t index, Format format);
// Writes it. A 2-state micromap keeps the low bit: the "better guess" of an unknown state.
void writeState(uint8_t *data, uint32_t index, Format format, State state);

// A point in barycentrics: the weights of vertex 1 (u) and vertex 2 (v).
struct Barycentrics {
    float u = 0;
    float v = 0;
};

// The three corners of micro-triangle `index` (0..4^level - 1), in the order of the curve's own vertices 0, 1, 2 where
// the orientation is kept. Coordinates are multiples of 2^-level and exact.
std::array<Barycentrics, 3> microTriangleCorners(uint32_t index, uint32_t level);

// VkMicromapTriangleEXT
struct MicromapTriangle {
    uint32_t dataOffset = 0;
    uint16_t subdivisionLevel = 0;
    Format format = Format::FourState;
};
static_assert(sizeof(MicromapTriangle) == 8);

// VkMicromapUsageEXT
struct MicromapUsage {
    uint32_t count = 0;
    uint32_t subdivisionLevel = 0;
    Format format = Format::FourState;
    bool operator==(const MicromapUsage &) const = default;
};

// The number of triangles of each level and format, as a micromap build needs it (pUsageCounts of
// VkMicromapBuildInfoEXT), sorted by format, then level.
std::vector<MicromapUsage> usageOf(std::span<const MicromapTriangle> triangles);
// The same of a geometry with these indices, which must be valid: each triangle counted as often as an index refers to
// it (VkAccelerationStructureTrianglesOpacityMicromapEXT).
std::vector<MicromapUsage> usageOf(std::span<const MicromapTriangle> triangles, std::span<const int32_t> indices,
                                   uint32_t baseTriangle);

struct Micromap {
    std::vector<MicromapTriangle> triangles;
    std::vector<uint8_t> data;
    std::vector<int32_t> indices; // one per geometry triangle: a micromap triangle or a special index
    uint32_t baseTriangle = 0;    // added to every index >= 0

    // State at barycentrics (u, v) of geometry triangle `triangle`. The micromap must be valid.
    [[nodiscard]] State stateAt(uint32_t triangle, float u, float v) const;
    // The first violation of the rules of the specification (levels, formats, data bounds, index bounds), naming the
    // triangle; nothing where the micromap is valid.
    [[nodiscard]] std::optional<std::string> validate() const;
};

} // namespace vellum
