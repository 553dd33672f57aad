// SPDX-License-Identifier: Apache-2.0
// The content of forced micromaps: one micromap, and patterns of indices that repeat over a geometry's triangles.
//
// A micromap overrides VK_GEOMETRY_OPAQUE_BIT_KHR: an unknown micro-triangle is non-opaque. So opaque geometries get
// opaque states, and others unknown ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "forcing/forcing.h"

namespace forcing
{

struct MicromapContent {
    std::vector<VkMicromapTriangleEXT> triangles;
    std::vector<uint8_t> data;
    std::vector<VkMicromapUsageEXT> usage; // one a triangle
};
const MicromapContent &micromapContent();

// Indices into the micromap's triangles, or special ones.
std::span<const int16_t> indexPattern(Content content, bool opaque);

} // namespace forcing
