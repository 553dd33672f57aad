// SPDX-License-Identifier: Apache-2.0
// Pictures of few colours.
#include <gtest/gtest.h>

#include "cli/picture/palette.h"

using namespace vellum::cli;

namespace
{

void expectExact(const Picture &picture, size_t colors)
{
    const Palette palette = makePalette(picture);
    EXPECT_EQ(palette.colors.size(), colors);
    ASSERT_EQ(palette.indices.size(), picture.pixels.size());
    for (size_t i = 0; i < picture.pixels.size(); ++i)
        ASSERT_EQ(palette.colors[palette.indices[i]], picture.pixels[i]) << "pixel " << i;
}

} // namespace

TEST(Palette, KeepsColorsThatAreFewEnough)
{
    Picture picture{1000, 1, {}};
    for (uint32_t i = 0; i < 1000; ++i)
        picture.pixels.push_back(0xff000000u | (i % 256) << 16 | (i * 7 % 256) << 8 | (255 - i % 256));
    expectExact(picture, 256);
    expectExact({2, 1, {0xff102030u, 0xff102030u}}, 1);
}

// One that is rare and next to a common one is not lost either.
TEST(Palette, KeepsARareNeighbour)
{
    for (const uint32_t rare : {0xff101011u, 0xff10100fu}) {
        Picture picture{500, 1, std::vector<uint32_t>(500, 0xff101010u)};
        picture.pixels[77] = rare;
        expectExact(picture, 2);
    }
}

TEST(Palette, HasAtMost256Colors)
{
    Picture picture{64, 64, {}};
    for (uint32_t i = 0; i < 64 * 64; ++i)
        picture.pixels.push_back(0xff000000u | (i % 64) * 4 << 8 | (i / 64) * 4);
    const Palette palette = makePalette(picture);
    EXPECT_EQ(palette.colors.size(), 256u);
    for (size_t i = 0; i < picture.pixels.size(); ++i) {
        const uint32_t chosen = palette.colors[palette.indices[i]];
        for (const unsigned shift : {0u, 8u}) {
            const int apart =
                static_cast<int>((chosen >> shift) & 255) - static_cast<int>((picture.pixels[i] >> shift) & 255);
            ASSERT_LE(std::abs(apart), 16) << "pixel " << i;
        }
    }
}
