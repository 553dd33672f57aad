// SPDX-License-Identifier: Apache-2.0
#include "bake/stencil.h"

#include <algorithm>
#include <cmath>

namespace vellum
{
namespace
{

constexpr size_t kWord = 64;

// Sets the bits from `first` to `last` of a row.
void setBits(std::vector<uint64_t> &bits, size_t rows, size_t row, size_t first, size_t last)
{
    for (size_t word = first / kWord; word <= last / kWord; ++word) {
        uint64_t set = ~uint64_t{0};
        if (word == first / kWord)
            set &= ~uint64_t{0} << (first % kWord);
        if (word == last / kWord)
            set &= ~uint64_t{0} >> (kWord - 1 - last % kWord);
        bits[word * rows + row] = set;
    }
}

} // namespace

void Stencil::make(const Placement &place, bool inverted)
{
    // Rounding down moves a cell by less than 1. All that it can be is a square around a place that does not depend on
    // the fraction, this far to each side.
    const double half = 1 + 4 * place.slack;
    const double reachX = half + place.marginX;
    const double reachY = half + place.marginY;
    const double turn = inverted ? -1 : 1;
    origin = {(inverted ? -place.high.x : place.low.x) - reachX, (inverted ? -place.high.y : place.low.y) - reachY};
    columns = static_cast<size_t>(place.high.x - place.low.x + 2 * reachX) + 1;
    rows = static_cast<size_t>(place.high.y - place.low.y + 2 * reachY) + 1;
    touched.assign((columns + kWord - 1) / kWord * rows, 0);
    within.assign(touched.size(), 0);
    // Functions that are not negative on the inner sides of the edges.
    struct Line {
        double x, y, constant;
    };
    const Line lines[] = {{turn * place.gradientI.x, turn * place.gradientI.y, 0},
                          {turn * place.gradientJ.x, turn * place.gradientJ.y, 0},
                          {-turn * place.gradientSum.x, -turn * place.gradientSum.y, place.area}};
    for (size_t row = 0; row < rows; ++row) {
        const double y = origin.y + static_cast<double>(row);
        // Sets the bits of the squares whose function is at least `sign` times what it changes by over this distance.
        const auto set = [&](std::vector<uint64_t> &bits, double sign, double farX, double farY) {
            double left = 0;
            double right = static_cast<double>(columns - 1);
            for (const Line &line : lines) {
                const double reach = std::abs(line.x) * farX + std::abs(line.y) * farY + place.lineSlack;
                const double rest = line.y * y + line.constant - sign * reach;
                if (line.x > 0)
                    left = std::max(left, -rest / line.x - origin.x);
                else if (line.x < 0)
                    right = std::min(right, -rest / line.x - origin.x);
                else if (rest < 0)
                    return;
            }
            if (std::ceil(left) <= right)
                setBits(bits, rows, row, static_cast<size_t>(std::ceil(left)), static_cast<size_t>(right));
        };
        set(touched, -1, reachX, reachY);
        set(within, 1, half, half);
    }
}

} // namespace vellum
