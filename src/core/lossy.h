// SPDX-License-Identifier: Apache-2.0
// Lossy micromaps (VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR): triangles get a lower subdivision level
// where few of their micro-triangles become unknown by it. What shaders/micromap_lossy*.comp do, bit for bit.
//
// A micro-triangle of the lower level is transparent or opaque where all of it was; otherwise it is unknown,
// transparent or opaque as most of it was (in 2-state override mode), and opaque where that is even. So a state only
// ever becomes an unknown one, as the specification has it. What becomes of a triangle depends on its states alone.
#pragma once

#include <cstdint>
#include <vector>

#include "core/micromap.h"
#include "core/records.h"

namespace vellum
{

// The level that a 4-state triangle of level 0..12 with these packed states gets: where the states to be stored (none
// up to level 2), and 2^priceLog2 for each of the triangle's micro-triangles that becomes unknown, are fewest together;
// of several the lowest. So at most 1 / 2^priceLog2 of the micro-triangles become unknown. priceLog2: 0..7.
uint32_t lossyLevel(const uint8_t *data, uint32_t level, uint32_t priceLog2 = shared::kLossyPriceLog2);

// The packed states of level `to` <= `level`.
std::vector<uint8_t> coarsenedStates(const uint8_t *data, uint32_t level, uint32_t to);

// A valid micromap as a lossy build makes it: the triangles in their order, each with data of its own. 2-state
// triangles stay as they are.
Micromap lossyMicromap(const Micromap &micromap, uint32_t priceLog2 = shared::kLossyPriceLog2);

} // namespace vellum
