// SPDX-License-Identifier: Apache-2.0
// The ranges of BakeOptions, stated once for the baker, libvellum and the command.
#pragma once

#include <array>
#include <limits>
#include <span>

#include "bake/bake.h"

namespace vellum
{

inline constexpr unsigned kMostBakeThreads = 1024;

// A number among BakeOptions: finite, and from 0 to `most`.
struct BakeNumber {
    const char *name; // of the member, also of VellumBakeOptions
    double BakeOptions::*member;
    double most;
    const char *range; // for messages: "x is 2, not 0 to 1"
    // The option's name, its unit and its help in the command.
    const char *option;
    const char *unit;
    const char *help;

    [[nodiscard]] constexpr bool accepts(double value) const { return value >= 0 && value <= most; }
};

inline constexpr double kAnyFinite = std::numeric_limits<double>::max();
inline constexpr std::array<BakeNumber, 6> kBakeNumbers = {{
    {"texelsPerEdge", &BakeOptions::texelsPerEdge, kAnyFinite, "0 or more and finite", "--texels-per-edge", "TEXELS",
     "For auto: the approximate length of a micro-triangle's edges in texels [4]"},
    {"minKnown", &BakeOptions::minKnown, 1, "0 to 1", "--min-known", "SHARE",
     "Share of a triangle that must be known for it to get data, 0 to 1 [0]"},
    {"valueTolerance", &BakeOptions::valueTolerance, kAnyFinite, "0 or more and finite", "--value-tolerance", "ALPHA",
     "Largest error of filtered alpha on a GPU [2/255]"},
    // Far larger values would only make triangles reach over all of the plane.
    {"subtexelTolerance", &BakeOptions::subtexelTolerance, 1024, "0 to 1024", "--subtexel-tolerance", "TEXELS",
     "Largest error of a sample's position [1/16]"},
    {"barycentricTolerance", &BakeOptions::barycentricTolerance, 1, "0 to 1", "--barycentric-tolerance", "DISTANCE",
     "How far outside of a micro-triangle a hit of it may be, in barycentrics [1e-5]"},
    {"interpolationTolerance", &BakeOptions::interpolationTolerance, 0x1p-10, "0 to 2^-10", "--interpolation-tolerance",
     "RATIO", "Largest error of interpolated texture coordinates, relative to the largest of a triangle [2^-20]"},
}};
inline constexpr const BakeNumber &kTexelsPerEdge = kBakeNumbers[0];
inline constexpr const BakeNumber &kMinKnown = kBakeNumbers[1];
inline constexpr std::span<const BakeNumber, 4> kBakeTolerances = std::span(kBakeNumbers).last<4>();

} // namespace vellum
