// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/known_surface.h"

#include <ctime>
#include <gtest/gtest.h>

using namespace vellum;

TEST(KnownSurface, SharesByArea)
{
    StoredMicromaps stored;
    // Level 1: transparent, opaque, opaque, unknown-opaque in 4 states; one of them opaque in 2.
    stored.micromaps = {{{{0, 1, Format::FourState}, {1, 1, Format::TwoState}}, {0xd4, 0x08}, {}}};
    stored.primitives[{0, 0}] = {0, {0, specialIndex(State::Opaque), -4, 1}, 0};
    stored.primitives[{0, 1}] = {0, {0}, 1};
    const StoredShares shares(stored);
    const auto surface = shares.of({{{0, 0}, {8, 2, 1, 4}}, {{0, 1}, {4}}, {{1, 0}, {1}}});
    ASSERT_TRUE(surface);
    EXPECT_EQ(surface->states, (std::array<double, 4>{8 / 20.0, 8 / 20.0, 0, 3 / 20.0}));
    EXPECT_EQ(surface->withoutMicromap, 1 / 20.0);
    EXPECT_EQ(surface->twoStates, 8 / 20.0);
    EXPECT_FALSE(shares.of({{{0, 0}, {0, 0, 0, 0}}}));
}

// A small file can have many primitives of one large micromap.
TEST(KnownSurface, CountsAMicromapOnce)
{
    constexpr uint32_t kLevel = 12;
    constexpr uint32_t kPrimitives = 4000;
    StoredMicromaps stored;
    stored.micromaps.push_back(
        {{{0, kLevel, Format::FourState}}, std::vector<uint8_t>(packedBytes(kLevel, Format::FourState)), {}});
    SurfaceAreas areas;
    for (uint32_t mesh = 0; mesh < kPrimitives; ++mesh) {
        stored.primitives[{mesh, 0}] = {0, {0}, 0};
        areas[{mesh, 0}] = {1};
    }
    const std::clock_t begin = std::clock();
    EXPECT_EQ(StoredShares(stored).of(areas)->known(), 1);
    EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, 5);
}
