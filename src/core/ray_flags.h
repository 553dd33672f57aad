// Ray flags on their way through a driver that knows no micromaps. C++ and GLSL; see shared.h.
//
// Opaque and CullNoOpaque would make the driver decide a hit without us, and it does not know
// ForceOpacityMicromap2State: all three are hidden, and travel in bits 11..13 where the driver carries them along
// unused. docs/architecture.md has the other ways.
#ifndef VELLUM_CORE_RAY_FLAGS_H
#define VELLUM_CORE_RAY_FLAGS_H

#ifdef __cplusplus
#include "core/opacity.h"
#else
#include "opacity.h"
#endif

VELLUM_SHARED_BEGIN

VELLUM_CONST uint kHiddenRayFlags = kRayOpaque | kRayCullNoOpaque | kRayForce2State;
VELLUM_CONST uint kCarriedRayFlags = 0x3800u;

// Ray flags as the driver gets them.
VELLUM_FN uint driverRayFlags(VELLUM_IN uint f)
{
    return (f & ~kHiddenRayFlags) | ((f & kRayOpaque) << 11u) | ((f & kRayCullNoOpaque) << 5u) |
           ((f & kRayForce2State) << 3u);
}

// Ray flags as the driver gets them where a ray does not consume micromaps: only what the driver does not know is
// hidden.
VELLUM_FN uint idleRayFlags(VELLUM_IN uint f)
{
    return (f & ~kRayForce2State) | ((f & kRayForce2State) << 3u);
}

// The inverse of both: ray flags as the application wrote them.
VELLUM_FN uint applicationRayFlags(VELLUM_IN uint f)
{
    return (f & ~kCarriedRayFlags) | ((f >> 11u) & kRayOpaque) | ((f >> 5u) & kRayCullNoOpaque) |
           ((f >> 3u) & kRayForce2State);
}

VELLUM_SHARED_END

#endif
