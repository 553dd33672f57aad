// SPDX-License-Identifier: Apache-2.0
// A triangle to verify, and the lattice of its micro-triangles' corners.
#pragma once

#include <array>
#include <cstdint>

namespace vellum::verify
{

// The values at a triangle's vertices 0, 1, 2.
struct TriangleCorners {
    std::array<float, 3> u{};
    std::array<float, 3> v{};
    std::array<float, 3> alpha{1, 1, 1}; // multiplied with the texture's value, interpolated
    // The largest value in a renderer's single-precision computation of u and v: margins are relative to this, where it
    // is more than the largest coordinate.
    float terms = 0;
    bool operator==(const TriangleCorners &) const = default;
};

// Vertex 0 is (0, 0), vertex 1 is (2^level, 0) and vertex 2 is (0, 2^level).
struct LatticePoint {
    int32_t i = 0;
    int32_t j = 0;
};
using MicroCorners = std::array<LatticePoint, 3>;

} // namespace vellum::verify
