// SPDX-License-Identifier: Apache-2.0
// The result of a hit: the specification's sections "Ray Opacity Micromap" and "Ray Opacity" (raytraversal.adoc), as
// one function. C++ and GLSL; see shared.h.
#ifndef VELLUM_CORE_OPACITY_H
#define VELLUM_CORE_OPACITY_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

// Micromap states, with the values of VkOpacityMicromapFormatEXT's 4-state data. A 2-state micromap holds the first
// two. A special index s (-1..-4) stands for the state ~s.
VELLUM_CONST uint kStateTransparent = 0u;
VELLUM_CONST uint kStateOpaque = 1u;
VELLUM_CONST uint kStateUnknownTransparent = 2u;
VELLUM_CONST uint kStateUnknownOpaque = 3u;
// The hit geometry has no micromap: its VK_GEOMETRY_OPAQUE_BIT_KHR decides.
VELLUM_CONST uint kStateNone = 4u;

// VkGeometryInstanceFlagBitsKHR
VELLUM_CONST uint kInstanceForceOpaque = 0x04u;
VELLUM_CONST uint kInstanceForceNoOpaque = 0x08u;
VELLUM_CONST uint kInstanceForce2State = 0x10u;
VELLUM_CONST uint kInstanceDisableMicromaps = 0x20u;

// SPIR-V RayFlags
VELLUM_CONST uint kRayOpaque = 0x001u;
VELLUM_CONST uint kRayNoOpaque = 0x002u;
VELLUM_CONST uint kRayCullOpaque = 0x040u;
VELLUM_CONST uint kRayCullNoOpaque = 0x080u;
VELLUM_CONST uint kRayForce2State = 0x400u;

// How traversal treats a candidate.
VELLUM_CONST uint kHitNonOpaque = 0u; // the shader decides
VELLUM_CONST uint kHitOpaque = 1u;    // committed without a call of the shader
VELLUM_CONST uint kHitIgnored = 2u;   // next candidate; the shader never sees it

// The result of a hit in a micro-triangle by the flags of the instance, before ray flags are applied. kStateNone: a hit
// on a non-opaque geometry without a micromap; a hit on an opaque one equals that in an opaque micro-triangle.
VELLUM_FN uint hitInInstance(VELLUM_IN uint state, VELLUM_IN uint instanceFlags)
{
    if (state == kStateTransparent)
        return kHitIgnored;
    if ((instanceFlags & kInstanceForceOpaque) != 0u)
        return kHitOpaque;
    if ((instanceFlags & kInstanceForceNoOpaque) != 0u)
        return kHitNonOpaque;
    return state == kStateOpaque ? kHitOpaque : kHitNonOpaque;
}

// The result after ray flags are applied.
VELLUM_FN uint hitOfRay(VELLUM_IN uint inInstance, VELLUM_IN uint rayFlags)
{
    // Without branches, which take drivers longer to compile. kRayOpaque wins over kRayNoOpaque.
    const uint opaque = ((inInstance & ~(rayFlags >> 1u)) | rayFlags) & 1u;
    const uint culled = (rayFlags >> (7u - opaque)) & 1u; // kRayCullOpaque is bit 6, kRayCullNoOpaque bit 7
    return (inInstance | (culled << 1u)) >= kHitIgnored ? kHitIgnored : opaque;
}

// Resolves a triangle candidate.
//   state          kState* found in the geometry's micromap, or kStateNone
//   geometryOpaque the geometry was built with VK_GEOMETRY_OPAQUE_BIT_KHR
//   instanceFlags  VkGeometryInstanceFlagsKHR as the application wrote them
//   rayFlags       RayFlags as the application passed them
VELLUM_FN uint resolveHit(VELLUM_IN uint state, VELLUM_IN bool geometryOpaque, VELLUM_IN uint instanceFlags,
                          VELLUM_IN uint rayFlags)
{
    uint effective = geometryOpaque ? kStateOpaque : kStateNone;
    if (state != kStateNone && (instanceFlags & kInstanceDisableMicromaps) == 0u) {
        const bool twoState = ((instanceFlags & kInstanceForce2State) | (rayFlags & kRayForce2State)) != 0u;
        effective = twoState ? (state & 1u) : state;
    }
    return hitOfRay(hitInInstance(effective, instanceFlags), rayFlags);
}

// hitInInstance() of all states for one instance: two bits for each state except kStateTransparent, which is always
// ignored, in the upper 8 bits of a word. A record that was never written is zero, and all its hits are kHitNonOpaque.
VELLUM_CONST uint kHitTableShift = 24u;
VELLUM_FN uint hitTable(VELLUM_IN uint instanceFlags)
{
    const bool twoState = (instanceFlags & kInstanceForce2State) != 0u;
    const uint opaque = hitInInstance(kStateOpaque, instanceFlags);
    const uint unknownTransparent =
        hitInInstance(twoState ? kStateTransparent : kStateUnknownTransparent, instanceFlags);
    const uint unknownOpaque = hitInInstance(twoState ? kStateOpaque : kStateUnknownOpaque, instanceFlags);
    const uint none = hitInInstance(kStateNone, instanceFlags);
    return (opaque | (unknownTransparent << 2u) | (unknownOpaque << 4u) | (none << 6u)) << kHitTableShift;
}

// The flags in a table: kInstanceForceOpaque and kInstanceForce2State.
VELLUM_FN uint flagsInTable(VELLUM_IN uint word)
{
    const uint none = word >> (kHitTableShift + 6u);
    const uint unknownTransparent = (word >> (kHitTableShift + 2u)) & 3u;
    return (none == kHitOpaque ? kInstanceForceOpaque : 0u) |
           (unknownTransparent == kHitIgnored ? kInstanceForce2State : 0u);
}

VELLUM_FN uint hitInTable(VELLUM_IN uint word, VELLUM_IN uint state)
{
    const uint shift = kHitTableShift - 2u; // where kStateTransparent would be
    return (((word & ~(3u << shift)) | (kHitIgnored << shift)) >> (shift + 2u * state)) & 3u;
}

VELLUM_SHARED_END

#endif
