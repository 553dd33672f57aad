// How many micro-triangles of a range have each state, without a look at each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/micromap.h"

namespace vellum::cli
{

// By State.
using StateCounts = std::array<uint64_t, 4>;

// Sums over blocks of the data make a count cost the same for every range. Triangles of untrusted files may all refer
// to the same large data: counting each one's micro-triangles singly could take for ever.
class StateCounter
{
public:
    // `data` must outlive this.
    explicit StateCounter(std::span<const uint8_t> data);

    // Of `count` micro-triangles from `first` on in the triangle's data, which must be inside of the data.
    [[nodiscard]] StateCounts count(const MicromapTriangle &triangle, uint64_t first, uint64_t count) const;
    // Of all.
    [[nodiscard]] StateCounts count(const MicromapTriangle &triangle) const
    {
        return count(triangle, 0, microTriangleCount(triangle.subdivisionLevel));
    }

private:
    // Of the data before that position, in micro-triangles of the format from the first byte on.
    [[nodiscard]] StateCounts before(uint64_t position, Format format) const;

    std::span<const uint8_t> data_;
    std::vector<StateCounts> four_; // before each block, as 4-state data
    std::vector<uint64_t> two_;     // opaque ones before each block, as 2-state data
};

} // namespace vellum::cli
