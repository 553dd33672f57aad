// SPDX-License-Identifier: Apache-2.0
// A picture of the triangle that a wrong ray meets: the expected states of its micro-triangles, and where the device
// agrees.
#pragma once

#include <functional>
#include <string>

#include "check/case/case.h"

namespace vellum::check
{

// SVG; empty: the ray meets no triangle, or one whose micro-triangles are too many to draw. `runs` runs a case that
// differs in its rays only: one at the centre of each micro-triangle.
std::string pictureOf(const Case &c, const Verdict &verdict, const std::function<Verdict(const Case &)> &runs);

} // namespace vellum::check
