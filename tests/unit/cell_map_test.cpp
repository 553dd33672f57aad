// SPDX-License-Identifier: Apache-2.0
// The bits of CellMap are what the texels of each cell say, one by one.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <thread>
#include <vector>

#include "bake/texture/cell_map.h"
#include "test_random.h"

using namespace vellum;

namespace
{

// 1: all four texels are opaque for sure, 0: transparent for sure, -1: neither.
int sideOf(const AlphaTexture &texture, const Thresholds &thresholds, int64_t x, int64_t y)
{
    bool opaque = true;
    bool transparent = true;
    for (const int64_t dx : {0, 1})
        for (const int64_t dy : {0, 1}) {
            const float alpha = texture.texel(x + dx, y + dy);
            opaque = opaque && std::isfinite(alpha) && double{alpha} >= thresholds.opaque;
            transparent = transparent && std::isfinite(alpha) && double{alpha} < thresholds.transparent;
        }
    return opaque ? 1 : transparent ? 0 : -1;
}

// Compares windows anywhere with the sides of their cells.
void compareWindows(const CellMap &map, const AlphaTexture &texture, test::TestRandom &random)
{
    for (int n = 0; n < 4; ++n) {
        const auto anywhere = [&](uint32_t size) {
            return static_cast<int64_t>(random() % (4 * size + 7)) - 2 * int64_t{size} - 3;
        };
        const int64_t x = anywhere(texture.width);
        const int64_t y = anywhere(texture.height);
        const size_t columns = 1 + random() % 64;
        std::vector<uint64_t> rows(1 + random() % 70, 1);
        const bool any = map.window(x, y, columns, rows.size(), rows.data());
        for (size_t row = 0; row < rows.size(); ++row) {
            uint64_t expected = 0;
            for (size_t k = 0; k < columns; ++k)
                if (map.side(x + static_cast<int64_t>(k), y + static_cast<int64_t>(row)) < 0)
                    expected |= uint64_t{1} << k;
            ASSERT_EQ(rows[row], expected) << columns << " columns from " << x << ", row " << y << " + " << row;
            ASSERT_TRUE(any || expected == 0);
        }
    }
}

} // namespace

TEST(BakeCellMap, MatchesTheTexels)
{
    test::TestRandom random(5);
    const float infinity = std::numeric_limits<float>::infinity();
    const float strange[] = {infinity,
                             -infinity,
                             std::numeric_limits<float>::quiet_NaN(),
                             std::numeric_limits<float>::max(),
                             -std::numeric_limits<float>::max(),
                             -0.0f};
    size_t sides[3] = {};
    for (const uint32_t width : {1u, 2u, 3u, 61u, 62u, 63u, 64u, 65u, 66u, 67u, 127u, 128u, 129u, 200u})
        for (const Wrap wrap : {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::MirrorOnce}) {
            AlphaTexture texture;
            texture.width = width;
            texture.height = 1 + random() % 5;
            texture.wrapU = wrap;
            texture.wrapV = static_cast<Wrap>(random() % 5);
            texture.border = random() % 4 == 0 ? infinity : static_cast<float>(random.uniform(0, 1));
            const bool anyStrange = random() % 2 == 0;
            double largest = std::isfinite(texture.border) ? double{texture.border} : 0;
            for (size_t i = 0; i < size_t{width} * texture.height; ++i) {
                // In patches, so that some cells are uniform.
                const bool high = (i / 7 + random() % 16 / 15) % 2 == 0;
                const double value = high ? random.uniform(0.5, 1.0) : random.uniform(-2.0, 0.4);
                texture.alpha.push_back(anyStrange && random() % 50 == 0 ? strange[random() % 6]
                                                                         : static_cast<float>(value));
                const float alpha = texture.alpha.back();
                largest = std::max(largest, std::isfinite(alpha) ? std::abs(double{alpha}) : 0);
            }
            for (const Thresholds &thresholds :
                 {Thresholds{0.45, 0.45}, Thresholds{0.4, 0.6}, Thresholds{-1e300, 1e300}}) {
                const CellMap map(texture, thresholds);
                EXPECT_EQ(map.largest(), largest);
                const auto w = static_cast<int64_t>(width);
                const auto h = static_cast<int64_t>(texture.height);
                for (int64_t y = -2 * h - 3; y <= 2 * h + 3; ++y)
                    for (int64_t x = -2 * w - 3; x <= 2 * w + 3; ++x) {
                        const int side = sideOf(texture, thresholds, x, y);
                        ASSERT_EQ(map.side(x, y), side)
                            << width << " x " << h << ", wrap " << static_cast<int>(wrap) << ", cell " << x << " " << y;
                        ++sides[side + 1];
                    }
                compareWindows(map, texture, random);
            }
        }
    EXPECT_GT(sides[0], 10000u);
    EXPECT_GT(sides[1], 10000u);
    EXPECT_GT(sides[2], 10000u);
}

// Bits are made by tile, in any order, by several threads. No column of a band without mixed cells is called mixed.
TEST(BakeCellMap, TilesAreMadeByAnyThread)
{
    test::TestRandom random(6);
    for (int n = 0; n < 20; ++n) {
        const uint32_t width = 150 + random() % 200;
        const uint32_t height = 100 + random() % 200;
        std::vector<uint8_t> bytes(size_t{width} * height);
        const size_t top = random() % 100;
        for (size_t i = 0; i < bytes.size(); ++i) { // opaque at the top and from column 56 to 136, noise elsewhere
            const bool opaque = i / width < top || (i % width >= 56 && i % width <= 136);
            bytes[i] = opaque ? 255 : static_cast<uint8_t>(random());
        }
        AlphaTexture texture = AlphaTexture::fromUnorm8(width, height, bytes.data(), 1, width);
        texture.wrapU = static_cast<Wrap>(random() % 5);
        texture.wrapV = static_cast<Wrap>(random() % 5);
        texture.border = 1;
        const Thresholds thresholds{0.5, 0.5};
        const CellMap map(texture, thresholds);
        std::atomic<size_t> wrong = 0;
        std::vector<std::thread> threads;
        for (int t = 0; t < 4; ++t)
            threads.emplace_back([&, first = random() % height] {
                for (int64_t i = 0; i < height; ++i)
                    for (int64_t x = -3; x < width + 3; ++x) {
                        const int64_t y = (first + i) % height;
                        wrong += map.side(x, y) != sideOf(texture, thresholds, x, y) ? 1 : 0;
                    }
            });
        for (std::thread &thread : threads)
            thread.join();
        EXPECT_EQ(wrong, 0u);
        compareWindows(map, texture, random);
        // Columns 66 to 120 are in one tile with any lead of the stored ones.
        const CellMap fresh(texture, thresholds);
        EXPECT_FALSE(fresh.anyMixedIn(66, 120));
        EXPECT_TRUE(fresh.anyMixedIn(0, 120));
        EXPECT_TRUE(fresh.anyMixedIn(-1000, 1000));
    }
}
