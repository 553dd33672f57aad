// SPDX-License-Identifier: Apache-2.0
// Counts the states in ranges of micro-triangles in constant time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "bake/packed.h"
#include "core/micromap.h"

namespace vellum
{

// Keeps sums over blocks of the data, so that every count costs the same. All triangles of an untrusted file may refer
// to the same large data; counting each micro-triangle on its own could then take hours.
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
