// The ray flags that the driver does not get: with Opaque and CullNoOpaque it would decide hits that are to be looked
// up, and it does not know ForceOpacityMicromap2State. docs/design/ray-flags.md says how they reach the shaders that
// need them.
#pragma once

#include "core/opacity.h"

namespace vellum::shared
{

inline constexpr uint kHiddenRayFlags = kRayOpaque | kRayCullNoOpaque | kRayForce2State;

} // namespace vellum::shared
