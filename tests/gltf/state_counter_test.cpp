// SPDX-License-Identifier: Apache-2.0
// Counting states in ranges of micro-triangles.
#include "gltf/micromaps/stored_micromaps.h"

#include <gtest/gtest.h>

using namespace vellum;

TEST(StateCounter, CountsEveryRange)
{
    std::vector<uint8_t> data(1000);
    uint32_t random = 1;
    for (uint8_t &byte : data)
        byte = static_cast<uint8_t>((random = random * 1664525u + 1013904223u) >> 24);
    const StateCounter counter(data);
    for (const Format format : {Format::TwoState, Format::FourState})
        for (uint16_t level = 0; level <= 5; ++level)
            for (uint32_t offset = 0; offset + packedBytes(level, format) <= data.size(); offset += 61) {
                const MicromapTriangle triangle{offset, level, format};
                for (uint32_t first = 0, all = microTriangleCount(level); first < all; first += all / 4 + 1) {
                    StateCounts expected{};
                    for (uint32_t i = first; i < all; ++i)
                        ++expected[static_cast<size_t>(readState(data.data() + offset, i, format))];
                    EXPECT_EQ(counter.count(triangle, first, all - first), expected) << offset << " " << level;
                }
            }
}

TEST(StateCounter, EndsWithTheData)
{
    const std::vector<uint8_t> data(128, 0xff);
    const StateCounter counter(data);
    EXPECT_EQ(counter.count({64, 4, Format::FourState}), (StateCounts{0, 0, 0, 256}));
    EXPECT_EQ(counter.count({96, 4, Format::TwoState}), (StateCounts{0, 256, 0, 0}));
}
