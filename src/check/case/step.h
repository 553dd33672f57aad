// SPDX-License-Identifier: Apache-2.0
// What steps act on, and what they make of a scene.
#pragma once

#include "check/case/case.h"

namespace vellum::check
{

// What the target of a step is.
enum class Target { Object, Micromap, Top };
Target targetOf(Step::Kind kind);

// Whether it updates that object. scene: after the step
bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene);

// The content of the scene after the step; copies change nothing.
void applyTo(oracle::Scene &scene, const Step &step);

} // namespace vellum::check
