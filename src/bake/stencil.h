// SPDX-License-Identifier: Apache-2.0
// The cells around a micro-triangle, for those that are larger than a few cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bake/placement.h"

namespace vellum
{

// The cells that the micro-triangles of one direction may touch, and those that lie within, wherever one stands. Bits
// as in CellMap::window(): a word for each row of the first 64 columns, then of the next ones.
struct Stencil {
    void make(const Placement &place, bool inverted);

    Point origin; // of the first cell, seen from the lattice point, to be rounded down to a whole cell
    size_t columns = 0;
    size_t rows = 0;
    std::vector<uint64_t> touched; // with margins and rounding
    std::vector<uint64_t> within;  // without margins
};

} // namespace vellum
