// SPDX-License-Identifier: Apache-2.0
#include "core/micromap.h"

#include <map>

#include "core/curve.h"

namespace vellum
{
namespace
{

using UsageKey = std::pair<Format, uint32_t>;

std::vector<MicromapUsage> toUsages(const std::map<UsageKey, uint32_t> &counts)
{
    std::vector<MicromapUsage> usages;
    for (const auto &[key, count] : counts)
        usages.push_back({count, key.second, key.first});
    return usages;
}

} // namespace

State readState(const uint8_t *data, uint32_t index, Format format)
{
    if (format == Format::TwoState)
        return static_cast<State>((data[index >> 3] >> (index & 7)) & 1);
    return static_cast<State>((data[index >> 2] >> ((index & 3) * 2)) & 3);
}

void writeState(uint8_t *data, uint32_t index, Format format, State state)
{
    const bool two = format == Format::TwoState;
    const uint32_t shift = two ? (index & 7) : (index & 3) * 2;
    const uint32_t mask = (two ? 1u : 3u) << shift;
    uint8_t &byte = data[two ? index >> 3 : index >> 2];
    byte = static_cast<uint8_t>((byte & ~mask) | ((static_cast<uint32_t>(state) << shift) & mask));
}

std::array<Barycentrics, 3> microTriangleCorners(uint32_t index, uint32_t level)
{
    // Vertices of the current sub-triangle in the curve's order, in steps of 2^-level.
    struct Point {
        int32_t u, v;
    };
    const int32_t size = 1 << level;
    Point a{0, 0};
    Point b{size, 0};
    Point c{0, size};
    for (uint32_t l = level; l-- > 0;) {
        const Point ab{(a.u + b.u) / 2, (a.v + b.v) / 2};
        const Point bc{(b.u + c.u) / 2, (b.v + c.v) / 2};
        const Point ca{(c.u + a.u) / 2, (c.v + a.v) / 2};
        // The curve enters a triangle at vertex 0 and leaves it at vertex 2, so each child starts where the one
        // before it ended.
        switch ((index >> (2 * l)) & 3) {
        case 0:
            b = ab;
            c = ca;
            break;
        case 1:
            a = ca;
            b = bc;
            c = ab;
            break;
        case 2:
            a = ab;
            c = bc;
            break;
        default:
            a = bc;
            b = ca;
            break;
        }
    }
    const float scale = 1.0f / static_cast<float>(size);
    const auto point = [scale](Point p) {
        return Barycentrics{static_cast<float>(p.u) * scale, static_cast<float>(p.v) * scale};
    };
    return {point(a), point(b), point(c)};
}

std::vector<MicromapUsage> usageOf(std::span<const MicromapTriangle> triangles)
{
    std::map<UsageKey, uint32_t> counts;
    for (const MicromapTriangle &t : triangles)
        ++counts[{t.format, t.subdivisionLevel}];
    return toUsages(counts);
}

std::vector<MicromapUsage> usageOf(std::span<const MicromapTriangle> triangles, std::span<const int32_t> indices,
                                   uint32_t baseTriangle)
{
    std::map<UsageKey, uint32_t> counts;
    for (const int32_t index : indices) {
        if (index < 0)
            continue;
        const MicromapTriangle &t = triangles[static_cast<uint32_t>(index) + baseTriangle];
        ++counts[{t.format, t.subdivisionLevel}];
    }
    return toUsages(counts);
}

State Micromap::stateAt(uint32_t triangle, float u, float v) const
{
    const int32_t index = indices[triangle];
    if (const auto special = specialState(index))
        return *special;
    const MicromapTriangle &t = triangles[static_cast<uint32_t>(index) + baseTriangle];
    return readState(data.data() + t.dataOffset, shared::curveIndex(u, v, t.subdivisionLevel), t.format);
}

std::optional<std::string> Micromap::validate() const
{
    for (size_t i = 0; i < triangles.size(); ++i) {
        const MicromapTriangle &t = triangles[i];
        const std::string where = "micromap triangle " + std::to_string(i) + ": ";
        if (t.format != Format::TwoState && t.format != Format::FourState)
            return where + "format " + std::to_string(static_cast<unsigned>(t.format)) +
                   " is neither 2-state nor 4-state";
        if (t.subdivisionLevel > shared::kMaxSubdivisionLevel)
            return where + "subdivision level " + std::to_string(t.subdivisionLevel) + " is above 12";
        const uint64_t end = uint64_t{t.dataOffset} + packedBytes(t.subdivisionLevel, t.format);
        if (end > data.size())
            return where + "its data ends at byte " + std::to_string(end) + " of " + std::to_string(data.size());
    }
    for (size_t i = 0; i < indices.size(); ++i) {
        const int64_t index = indices[i];
        if (specialState(indices[i]))
            continue;
        const int64_t target = index + baseTriangle;
        if (index < 0 || target >= static_cast<int64_t>(triangles.size()))
            return "geometry triangle " + std::to_string(i) + ": index " + std::to_string(index) + " + base triangle " +
                   std::to_string(baseTriangle) + " is outside the micromap's " + std::to_string(triangles.size()) +
                   " triangles";
    }
    return std::nullopt;
}

} // namespace vellum
