// What a hit means: the specification's "Ray Opacity Micromap" and "Ray Opacity" sections (raytraversal.adoc), as
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

// What traversal does with a candidate.
VELLUM_CONST uint kHitIgnored = 0u;   // next candidate; the shader never sees it
VELLUM_CONST uint kHitOpaque = 1u;    // committed without asking the shader
VELLUM_CONST uint kHitNonOpaque = 2u; // the shader decides

// Resolves a triangle candidate.
//   state          kState* found in the geometry's micromap, or kStateNone
//   geometryOpaque the geometry was built with VK_GEOMETRY_OPAQUE_BIT_KHR
//   instanceFlags  VkGeometryInstanceFlagsKHR as the application wrote them
//   rayFlags       RayFlags as the application passed them
VELLUM_FN uint resolveHit(VELLUM_IN uint state, VELLUM_IN bool geometryOpaque, VELLUM_IN uint instanceFlags,
                          VELLUM_IN uint rayFlags)
{
    uint hit = geometryOpaque ? kHitOpaque : kHitNonOpaque;
    if (state != kStateNone && (instanceFlags & kInstanceDisableMicromaps) == 0u) {
        const bool twoState = ((instanceFlags & kInstanceForce2State) | (rayFlags & kRayForce2State)) != 0u;
        const uint effective = twoState ? (state & 1u) : state;
        if (effective == kStateTransparent)
            return kHitIgnored;
        hit = effective == kStateOpaque ? kHitOpaque : kHitNonOpaque;
    }
    if ((instanceFlags & kInstanceForceOpaque) != 0u)
        hit = kHitOpaque;
    else if ((instanceFlags & kInstanceForceNoOpaque) != 0u)
        hit = kHitNonOpaque;
    if ((rayFlags & kRayOpaque) != 0u)
        hit = kHitOpaque;
    else if ((rayFlags & kRayNoOpaque) != 0u)
        hit = kHitNonOpaque;
    if (hit == kHitOpaque && (rayFlags & kRayCullOpaque) != 0u)
        return kHitIgnored;
    if (hit == kHitNonOpaque && (rayFlags & kRayCullNoOpaque) != 0u)
        return kHitIgnored;
    return hit;
}

VELLUM_SHARED_END

#endif
