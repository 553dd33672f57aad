// SPDX-License-Identifier: Apache-2.0
// The contents of an inspected file, in numbers.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "inspect/inspected_file.h"

namespace vellum::inspect
{

struct Tally {
    uint64_t triangles = 0;
    uint64_t sharing = 0; // triangles whose micromap triangle an earlier one refers to as well
    std::array<std::array<uint64_t, 2>, 13> levels{}; // triangles by level; of 2-state, of 4-state data
    std::array<uint64_t, 4> special{};                // triangles by the State of their special index
    std::array<double, 4> states{};                   // share of all triangles' area by State, in sum 1
    std::array<double, 4> uvArea{};                   // by State, in squares of the unit of UVs
    uint64_t recordsUsed = 0;                         // micromap triangles that a chosen triangle refers to
    uint64_t dataBytes = 0;                           // of those micromap triangles' data
    uint64_t indexBytes = 0;
};

// The tally of the chosen triangles.
Tally tallyOf(const InspectedFile &file);
// The tally of one primitive's triangles.
Tally tallyOf(const InspectedFile &file, const InspectedPrimitive &primitive);

// The tally of those primitives' triangles.
Tally tallyOf(const InspectedFile &file, std::span<const InspectedPrimitive *const> primitives);

// The tally of all triangles with one material, of InspectedFile::materials.
Tally tallyOfMaterial(const InspectedFile &file, uint32_t material);

// Share of each State; for a special index 1 for its own.
std::array<double, 4> stateShares(const InspectedFile &file, int32_t record);
// 0 for a special index.
uint64_t dataBytes(const InspectedFile &file, int32_t record);
// In squares of the unit of UVs; 0 if it is not a finite number.
double uvArea(const TriangleUvs &uvs);

} // namespace vellum::inspect
