// SPDX-License-Identifier: Apache-2.0
// Painted twigs: the textures of the built-in grove.
#pragma once

#include <cstdint>

#include "gltf/scene.h"

namespace vellum::cli
{

// What a kind of leaf looks like. Lengths are in sizes of the texture.
struct LeafStyle {
    uint64_t seed = 1;
    int leaves = 11;                 // along the twig, alternating, and one at its tip
    float length = 0.30f;            // of a leaf blade
    float width = 0.17f;             // of a leaf blade, where it is widest
    float widest = 0.42f;            // where that is, from stalk (0) to tip (1)
    float teeth = 0;                 // depth of the edge's teeth, as a share of the width
    int veins = 7;                   // pairs of side veins
    Vec3 young{0.40f, 0.53f, 0.20f}; // the leaves' sRGB colours are between these
    Vec3 old{0.19f, 0.33f, 0.12f};
    Vec3 wood{0.33f, 0.25f, 0.16f};
};

// A square picture with the twig growing from the middle of the bottom edge (the last row) to the top; alpha is how
// much of a texel is covered. Texels without any leaf have the leaves' mean colour, so that no dark rim is filtered in.
Image paintTwig(const LeafStyle &style, uint32_t size);

} // namespace vellum::cli
