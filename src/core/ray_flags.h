// SPDX-License-Identifier: Apache-2.0
// The ray flags that the driver does not get: with Opaque and CullNoOpaque it would decide hits before they are looked
// up, and it does not know ForceOpacityMicromap2State. How shaders get them: docs/design/ray-flags.md.
#pragma once

#include "core/opacity.h"

namespace vellum::shared
{

inline constexpr uint kHiddenRayFlags = kRayOpaque | kRayCullNoOpaque | kRayForce2State;

} // namespace vellum::shared
