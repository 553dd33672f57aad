// SPDX-License-Identifier: Apache-2.0
// Judges what a ray query saw.
#pragma once

#include <string>

#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

// What is wrong with the result of a ray whose hits, by allHits, are not unsure; empty: nothing.
std::string queryFault(const Ray &ray, const std::vector<Hit> &hits, const Result &result);

} // namespace vellum::check::oracle
