// SPDX-License-Identifier: Apache-2.0
// What is attempted to make a case smaller.
#pragma once

#include "check/case/shrink/attempts.h"

namespace vellum::check
{

// Rays, steps, instances, objects, meshes, triangles, micromaps and their triangles that the failure does not need.
void removeParts(Attempts &attempts, std::optional<uint32_t> ray);
// States, levels and formats.
void simplifyMicromaps(Attempts &attempts);
// How meshes use micromaps.
void simplifyUses(Attempts &attempts);
// Instances, rays and coordinates.
void simplifyScene(Attempts &attempts);
// How it is built and traced, and the kinds of steps.
void simplifyPlans(Attempts &attempts);

} // namespace vellum::check
