// SPDX-License-Identifier: Apache-2.0
// The specification's rules for a triangle hit, written out as its tables ("Ray Opacity Micromap", "Ray Opacity
// Culling" of raytraversal.adoc). This is deliberately not Vellum's own code, which is compared with it.
#pragma once

#include <cstdint>

#include "gpu/tracer.h"

namespace vellum::check
{
using namespace gpu;
} // namespace vellum::check

namespace vellum::check::oracle
{

enum class Outcome { Ignored, Opaque, NonOpaque, Culled };

inline constexpr int kNoMicromap = -1; // of a triangle
inline constexpr int kBox = -2;

// A layer above gives triangles without a micromap one of the states opaque and unknown-opaque: the tests' forcing
// layer.
inline bool everyTriangleHasMicromap = false;

inline int stateWithoutMicromap(bool geometryOpaque)
{
    return !everyTriangleHasMicromap ? kNoMicromap : geometryOpaque ? 1 : 3;
}

// state: the 4-state value 0..3 (a 2-state value is 0 or 1, special index s stands for -1 - s), kNoMicromap or kBox.
inline Outcome outcomeOf(int state, bool geometryOpaque, uint32_t instanceFlags, uint32_t rayFlags)
{
    // Rows: value; columns: ordinary mode, 2-state override.
    constexpr Outcome table[4][2] = {
        {Outcome::Ignored, Outcome::Ignored},
        {Outcome::Opaque, Outcome::Opaque},
        {Outcome::NonOpaque, Outcome::Ignored},
        {Outcome::NonOpaque, Outcome::Opaque},
    };
    Outcome outcome;
    if (state == kNoMicromap)
        state = stateWithoutMicromap(geometryOpaque);
    if (state < 0 || (instanceFlags & kFlagDisable) != 0) {
        outcome = geometryOpaque ? Outcome::Opaque : Outcome::NonOpaque;
    } else {
        const bool override = (instanceFlags & kFlagTwoState) != 0 || (rayFlags & kRayForceTwoState) != 0;
        outcome = table[state][override ? 1 : 0];
    }
    if (outcome == Outcome::Ignored)
        return outcome; // "no further processing of that candidate is done"

    const bool forcedOpaque = (instanceFlags & VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR) != 0;
    const bool forcedNonOpaque = (instanceFlags & VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR) != 0;
    if (forcedOpaque)
        outcome = Outcome::Opaque;
    if (forcedNonOpaque)
        outcome = Outcome::NonOpaque;

    // The four opacity ray flags exclude each other.
    switch (rayFlags & (kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRayCullNoOpaque)) {
    case kRayOpaque: return Outcome::Opaque;
    case kRayNoOpaque: return Outcome::NonOpaque;
    case kRayCullOpaque: return outcome == Outcome::Opaque ? Outcome::Culled : outcome;
    case kRayCullNoOpaque: return outcome == Outcome::NonOpaque ? Outcome::Culled : outcome;
    default: return outcome;
    }
}

} // namespace vellum::check::oracle
