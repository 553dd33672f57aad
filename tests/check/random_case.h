// SPDX-License-Identifier: Apache-2.0
// Random cases that use everything a case can have.
#pragma once

#include "check/case/case.h"
#include "check/oracle/random_scene.h"

vellum::check::Case randomCase(uint32_t seed, uint32_t rays = 40);
