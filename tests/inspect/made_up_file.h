// SPDX-License-Identifier: Apache-2.0
// An InspectedFile made up for tests.
#pragma once

#include "inspect/inspected_file.h"

namespace vellum::test
{

// One material and one micromap with two triangles: a 4-state one of level 2, whose micro-triangle i has the state i %
// 4, and a 2-state one of level 3, whose first half is opaque. One primitive with five triangles: a square of the first
// and the second, the second again, one that is opaque all over, and one that is unknown-transparent and has NaN
// coordinates.
inspect::InspectedFile madeUpFile();

} // namespace vellum::test
