// SPDX-License-Identifier: Apache-2.0
// Stencils of micro-triangles against points of them.
#include <gtest/gtest.h>

#include <cmath>

#include "bake/stencil.h"
#include "test_random.h"

using namespace vellum;

namespace
{

struct StencilTally {
    size_t within = 0;
    size_t wrong = 0;
    size_t wide = 0;
};

class StencilCase
{
public:
    explicit StencilCase(unsigned seed) : random_(seed)
    {
        texture_.width = 1 + random_() % 300;
        texture_.height = 1 + random_() % 300;
        texture_.alpha.resize(texture_.texelCount());
        if (random_() % 2 == 0)
            options_.exactly();
        else
            options_.subtexelTolerance = random_.uniform(0, 3);
        const bool grid = random_() % 3 == 0;
        for (TexCoord &uv : uvs_) {
            const auto coordinate = [&] {
                const double x = random_.uniform(-1, 1);
                return static_cast<float>(grid ? std::round(x * 8) / 8 : x);
            };
            uv = {coordinate(), coordinate()};
        }
        level_ = random_() % 4;
    }

    void compare(StencilTally &tally)
    {
        const CellMap map(texture_, {0.5, 0.5});
        const Placement place(texture_, map, options_, uvs_, level_);
        for (const int32_t size : {1, -1}) {
            Stencil stencil;
            stencil.make(place, size < 0);
            tally.wide += stencil.columns > 64 ? 1u : 0u;
            for (int n = 0; n < 4; ++n) {
                const auto steps = uint32_t{1} << level_;
                const auto i = static_cast<int32_t>(random_() % (steps + 1));
                compare(place, stencil, {i, static_cast<int32_t>(random_() % (steps + 1)), size}, tally);
            }
        }
    }

private:
    void compare(const Placement &place, const Stencil &stencil, const SubTriangle &sub, StencilTally &tally)
    {
        const Point corner = place.at(sub.i, sub.j);
        const double x = std::floor(corner.x + stencil.origin.x);
        const double y = std::floor(corner.y + stencil.origin.y);
        const auto has = [&](const std::vector<uint64_t> &bits, double column, double row) {
            if (!(column >= 0 && row >= 0 && column < static_cast<double>(stencil.columns) &&
                  row < static_cast<double>(stencil.rows)))
                return false;
            const auto k = static_cast<size_t>(column);
            return (bits[k / 64 * stencil.rows + static_cast<size_t>(row)] >> k % 64 & 1) != 0;
        };
        // A point of the micro-triangle, or just beside, is in a cell that it may touch.
        for (int n = 0; n < 50; ++n) {
            double a = random_.uniform(0, 1);
            double b = n % 3 == 0 ? 0 : random_.uniform(0, 1);
            if (a + b > 1) {
                a = 1 - a;
                b = 1 - b;
            }
            const double px =
                corner.x + sub.size * (a * place.stepI.x + b * place.stepJ.x) + place.marginX * random_.uniform(-1, 1);
            const double py =
                corner.y + sub.size * (a * place.stepI.y + b * place.stepJ.y) + place.marginY * random_.uniform(-1, 1);
            tally.wrong += has(stencil.touched, std::floor(px) - x, std::floor(py) - y) ? 0u : 1u;
        }
        // The corners of a cell within are points of it.
        const auto isInside = [&](double px, double py) {
            const double dx = sub.size * (px - corner.x);
            const double dy = sub.size * (py - corner.y);
            const double i = dx * place.gradientI.x + dy * place.gradientI.y;
            const double j = dx * place.gradientJ.x + dy * place.gradientJ.y;
            return i >= 0 && j >= 0 && i + j <= place.area;
        };
        for (double row = 0; row < static_cast<double>(stencil.rows); ++row)
            for (double column = 0; column < static_cast<double>(stencil.columns); ++column) {
                if (!has(stencil.within, column, row))
                    continue;
                ++tally.within;
                for (const double right : {0.0, 1.0})
                    for (const double below : {0.0, 1.0})
                        tally.wrong += isInside(x + column + right, y + row + below) ? 0u : 1u;
            }
    }

    test::TestRandom random_;
    AlphaTexture texture_;
    BakeOptions options_;
    TriangleUvs uvs_;
    uint32_t level_;
};

} // namespace

TEST(BakeStencil, HasThePointsOfEveryMicroTriangle)
{
    StencilTally tally;
    for (unsigned seed = 0; seed < 500; ++seed) {
        StencilCase(seed).compare(tally);
        ASSERT_EQ(tally.wrong, 0u) << "seed " << seed;
    }
    EXPECT_GT(tally.within, 100000u);
    EXPECT_GT(tally.wide, 100u);
}
