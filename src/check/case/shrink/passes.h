// SPDX-License-Identifier: Apache-2.0
// What is attempted to make a case smaller.
#pragma once

#include "check/case/shrink/attempts.h"

namespace vellum::check
{

void removeRays(Attempts &attempts, std::optional<uint32_t> ray);
// All triangles of micromaps get one of the lowest levels at once, if the case still fails. Takes few runs: in a large
// scene, nothing else may lower them in time.
void lowerAllLevels(Attempts &attempts);
// Rays, steps, instances, objects, meshes, triangles, micromaps and their triangles that the failure does not need.
void removeParts(Attempts &attempts);
// States, levels and formats.
void simplifyMicromaps(Attempts &attempts);
// How meshes use micromaps.
void simplifyUses(Attempts &attempts);
// Instances, rays and coordinates.
void simplifyScene(Attempts &attempts);
// How it is built and traced, and the kinds of steps.
void simplifyPlans(Attempts &attempts);

} // namespace vellum::check
