// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/micromap.h"
#include "vellum/vellum.h"

namespace vellum::library
{

static_assert(sizeof(VellumMicromapTriangle) == sizeof(MicromapTriangle));
// Both structures have the same layout, as their comments state.
inline const VellumMicromapTriangle *trianglesOf(std::span<const MicromapTriangle> triangles)
{
    return reinterpret_cast<const VellumMicromapTriangle *>(triangles.data());
}

// The number of micromap triangles, or of uses of them, for each format and level.
class UsageCounts
{
public:
    void add(const MicromapTriangle &triangle)
    {
        ++counts_[triangle.format == Format::TwoState ? 0 : 1][triangle.subdivisionLevel];
    }
    [[nodiscard]] std::vector<VellumMicromapUsage> get() const
    {
        std::vector<VellumMicromapUsage> usages;
        for (size_t i = 0; i < counts_.size(); ++i)
            for (uint32_t level = 0; level < counts_[i].size(); ++level)
                if (counts_[i][level] != 0)
                    usages.push_back(
                        {counts_[i][level], level,
                         i == 0 ? uint32_t{VELLUM_MICROMAP_FORMAT_2_STATE} : uint32_t{VELLUM_MICROMAP_FORMAT_4_STATE}});
        return usages;
    }

private:
    std::array<std::array<uint32_t, 13>, 2> counts_{};
};

// The usage counts of a micromap.
inline std::vector<VellumMicromapUsage> usagesOf(std::span<const MicromapTriangle> triangles)
{
    UsageCounts counts;
    for (const MicromapTriangle &triangle : triangles)
        counts.add(triangle);
    return counts.get();
}

// The usage counts of a geometry with these indices, which must be valid.
inline std::vector<VellumMicromapUsage> usagesOf(std::span<const MicromapTriangle> triangles,
                                                 std::span<const int32_t> indices, uint32_t baseTriangle)
{
    UsageCounts counts;
    for (const int32_t index : indices)
        if (index >= 0)
            counts.add(triangles[static_cast<size_t>(index) + baseTriangle]);
    return counts.get();
}

} // namespace vellum::library
