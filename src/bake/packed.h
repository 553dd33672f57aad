// SPDX-License-Identifier: Apache-2.0
// Packed states in bulk: counting, halving and folding them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "bake/bake.h"
#include "core/micromap.h"

namespace vellum
{

// Micro-triangles by State.
using StateCounts = std::array<uint64_t, 4>;

// Counts the states of 4-state data of a level.
StateCounts countStates(const uint8_t *data, uint32_t level);

// The state that all of them are.
std::optional<State> uniformState(const StateCounts &counts);

// Turns 4-state data into 2-state data, in place; what is left over behind it is undefined.
void toTwoState(uint8_t *data, uint32_t level, TwoStateRule rule);

// Makes opaque what is transparent and the other way round, known or not, in 4-state data.
void swapOutcomes(uint8_t *data, uint32_t level);

// Keeps the states of `data` that `other` has, too, and makes the others unknown: 4-state data that holds for two
// textures.
void keepCommon(uint8_t *data, const uint8_t *other, uint32_t level);

// Turns 4-state data of a level, above 0, into that of the level below, in place: a state is known if those of its four
// parts are and agree.
void foldOnce(uint8_t *data, uint32_t level);

} // namespace vellum
