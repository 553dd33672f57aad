// SPDX-License-Identifier: Apache-2.0
// The input of the benchmarks of the bakers, and their clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace vellum::bench
{

// The time of all threads of the process.
double userSeconds();

// Toothed leaves with soft borders at random places of a texture that repeats, until 40 % of it is covered.
std::vector<uint8_t> paintLeaves(uint32_t size);

// Triangles with edges of 60 to 100 texels at random places, turned at random.
std::vector<TriangleUvs> scatter(size_t count, uint32_t size);

} // namespace vellum::bench
