// SPDX-License-Identifier: Apache-2.0
// The targets of steps, and their effect on a scene.
#pragma once

#include "check/case/case.h"

namespace vellum::check
{

// The type of a step's target.
enum class Target { Object, Micromap, Top };
Target targetOf(Step::Kind kind);

// Returns whether the step updates that object. scene: after the step
bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene);

// The content of the scene after the step; copies change nothing.
void applyTo(oracle::Scene &scene, const Step &step);

} // namespace vellum::check
