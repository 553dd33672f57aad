// SPDX-License-Identifier: Apache-2.0
// The quick tests of the classifier against its exact one: they may be undecided, but never wrong.
#include <gtest/gtest.h>

#include <cmath>

#include "bake/exact.h"
#include "bake/piece.h"
#include "bake/placement.h"
#include "test_random.h"

using namespace vellum;

namespace
{

struct Tally {
    size_t all = 0;
    size_t quickOpen = 0;
    size_t open = 0;
    size_t wrong = 0;
};

class Case
{
public:
    // Coordinates on a grid, where alpha equals the cutoff and sides run along borders of cells, or anywhere; values
    // and coordinates of any magnitude.
    explicit Case(unsigned seed) : random_(seed)
    {
        constexpr uint32_t kSizes[] = {1, 2, 3, 5, 8, 13};
        texture.width = kSizes[random_() % std::size(kSizes)];
        texture.height = kSizes[random_() % std::size(kSizes)];
        texture.wrapU = static_cast<Wrap>(random_() % 5);
        texture.wrapV = static_cast<Wrap>(random_() % 5);
        texture.filter = random_() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        const int exponent = random_() % 2 == 0 ? 0 : static_cast<int>(random_() % 250) - 140;
        const unsigned values = random_() % 2 == 0 ? 5 : 1000;
        for (uint32_t i = 0; i < texture.width * texture.height; ++i)
            texture.alpha.push_back(
                std::ldexp(static_cast<float>(random_() % values) / static_cast<float>(values - 1), exponent));
        if (random_() % 8 == 0)
            texture.alpha[random_() % texture.alpha.size()] = random_() % 2 == 0 ? NAN : INFINITY;
        options.exactly();
        options.cutoff = std::ldexp(random_() % 2 == 0 ? 0.5 : random_.uniform(0, 1), exponent);
        const bool grid = random_() % 2 == 0;
        const double far = random_() % 4 == 0 ? 1000 : 2;
        const double size = std::ldexp(1, random_() % 3 == 0 ? -static_cast<int>(random_() % 40) : 0);
        const double u = std::floor(random_.uniform(-far, far));
        const double v = std::floor(random_.uniform(-far, far));
        for (TexCoord &uv : uvs) {
            const auto coordinate = [&](double start) {
                const double x = random_.uniform(0, 2);
                return static_cast<float>(start + size * (grid ? std::round(x * 16) / 16 : x));
            };
            uv = {coordinate(u), coordinate(v)};
        }
        if (random_() % 6 == 0)
            uvs[2] = random_() % 2 == 0 ? uvs[1] : TexCoord{uvs[0].u, std::nextafter(uvs[0].v, 2000.0f)};
        level = random_() % 4;
    }

    void compare(Tally &tally)
    {
        const Thresholds thresholds{options.cutoff, options.cutoff};
        const CellMap map(texture, thresholds);
        const Placement place(texture, map, options, uvs, level);
        const PieceTest piece(place, texture.filter, thresholds);
        const ExactTriangle exact(texture, options.cutoff, uvs, level);
        std::vector<Cell> cells;
        const int32_t steps = 1 << level;
        place.forMixed(map, {0, 0, steps}, [&](const CellMap::Place &cell) {
            cells.push_back(map.read(cell));
            return false;
        });
        for (int32_t i = 0; i <= steps; ++i) {
            for (int32_t j = 0; i + j <= steps; ++j) {
                if (i + j < steps)
                    compare({i, j, 1}, cells, place, piece, exact, tally);
                if (i > 0 && j > 0)
                    compare({i, j, -1}, cells, place, piece, exact, tally);
            }
        }
    }

    AlphaTexture texture;
    BakeOptions options;
    TriangleUvs uvs;
    uint32_t level;

private:
    void compare(const SubTriangle &sub, const std::vector<Cell> &cells, const Placement &place, const PieceTest &piece,
                 const ExactTriangle &exact, Tally &tally)
    {
        const auto truth = [&](Cell cell) {
            cell.x += place.unwrappedX - place.baseX;
            cell.y += place.unwrappedY - place.baseY;
            return exact.crosses({{{sub.i, sub.j}, {sub.i + sub.size, sub.j}, {sub.i, sub.j + sub.size}}}, cell);
        };
        bool anywhere = false;
        std::vector<bool> crosses;
        for (const Cell &cell : cells) {
            crosses.push_back(truth(cell));
            anywhere = anywhere || crosses.back();
        }
        for (size_t n = 0; n < cells.size(); ++n) {
            const Cell &cell = cells[n];
            Point corner = place.at(sub.i, sub.j);
            corner.x -= static_cast<double>(cell.x - place.baseX);
            corner.y -= static_cast<double>(cell.y - place.baseY);
            const Crossing slow = piece(corner, sub.size < 0, cell);
            NearCell near{};
            piece.setValues(near, cell);
            const Crossing quick =
                texture.filter == Filter::Nearest ? Crossing::Open : piece.quick(corner, sub.size < 0, near);
            ++tally.all;
            tally.open += slow == Crossing::Open ? 1u : 0u;
            tally.quickOpen += quick == Crossing::Open ? 1u : 0u;
            for (const Crossing crossing : {slow, quick}) {
                // A crossing that they report may be just outside the cell.
                const bool wrong = (crossing == Crossing::No && crosses[n]) || (crossing == Crossing::Yes && !anywhere);
                tally.wrong += wrong ? 1u : 0u;
            }
        }
    }

    test::TestRandom random_;
};

} // namespace

TEST(BakePiece, QuickTestsNeverContradictTheExactOne)
{
    Tally tally;
    for (unsigned seed = 0; seed < 3000 && tally.wrong == 0; ++seed) {
        Case c(seed);
        if (!usable(c.uvs, c.texture))
            continue;
        c.compare(tally);
        EXPECT_EQ(tally.wrong, 0u) << "seed " << seed;
    }
    // Tests that decide nothing would pass, too.
    EXPECT_LT(tally.open, tally.all / 2);
    EXPECT_GT(tally.open, tally.all / 100);
    RecordProperty("pieces", std::to_string(tally.all));
    RecordProperty("open", std::to_string(tally.open));
    RecordProperty("quickOpen", std::to_string(tally.quickOpen));
}
