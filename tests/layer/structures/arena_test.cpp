// SPDX-License-Identifier: Apache-2.0
// The arena of the tests detects what it is meant to detect.
#include <gtest/gtest-spi.h>

#include "gpu/arena.h"
#include "harness/harness.h"

namespace
{

using namespace vt;

TEST(Pieces, LieAtTheSmallestAlignmentAndAreFreeAtOnce)
{
    std::vector<uint8_t> bytes(4096);
    Pieces pieces(bytes, 0x10000);
    const auto first = pieces.take(100, 256);
    const auto second = pieces.take(100, 8);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(*first % 512, 256u);
    EXPECT_EQ(*second % 16, 8u);
    EXPECT_LT(*second + 100, *first) << "the lowest place is not used";
    pieces.give(*first);
    EXPECT_EQ(pieces.take(200, 256), first);
    EXPECT_FALSE(pieces.take(4096, 1));
}

TEST(Pieces, EveryGuardByteCounts)
{
    std::vector<uint8_t> bytes(1024);
    Pieces pieces(bytes, 0);
    const size_t first = *pieces.take(64, 64), second = *pieces.take(64, 64);
    for (size_t i = 0; i < bytes.size(); ++i) {
        const bool taken = (i >= first && i < first + 64) || (i >= second && i < second + 64);
        const uint8_t was = std::exchange(bytes[i], uint8_t{7});
        EXPECT_EQ(pieces.damage().has_value(), !taken) << i;
        const bool beside = !taken && i > second - Pieces::kGap && i < second + 64 + Pieces::kGap;
        EXPECT_TRUE(!beside || pieces.damageBeside(second)) << i;
        bytes[i] = was;
    }
    EXPECT_FALSE(pieces.damage());
}

class ArenaTest : public GpuTest
{
protected:
    ArenaTest() : GpuTest({.memory = Memory::PackedToTheEnd}) {}
};

TEST_F(ArenaTest, HandlesReachToTheEndOfTheBufferOrLess)
{
    std::vector<std::unique_ptr<Guarded>> all;
    for (const VkDeviceSize size : {1000u, 1250u, 1000u, 1250u, 1000u, 1250u})
        all.push_back(
            std::make_unique<Guarded>(gpu(), size, 256, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR));
    std::map<VkDeviceSize, int> ends;
    for (const auto &one : all) {
        EXPECT_EQ(one->buffer(), all.front()->buffer());
        EXPECT_EQ(one->address() % 256, 0u);
        EXPECT_GE(one->handleSize(), one->size());
        ++ends[one->offset() + one->handleSize()];
    }
    EXPECT_GT(ends.size(), 1u);          // some end earlier
    EXPECT_GT(ends.rbegin()->second, 1); // the others at the end
}

TEST_F(ArenaTest, ProtectedBytesAreCompared)
{
    const Guarded a(gpu(), 64, 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const Guarded b(gpu(), 64, 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    Arena::Snapshot before(*gpu().arena());
    b.bytes()[63] ^= 1;
    before.expectOnlyChanged(std::array{b.range()}, "a write to b");
    a.bytes()[0] ^= 1;
    EXPECT_NONFATAL_FAILURE(before.expectOnlyChanged(std::array{b.range()}, "a write to a"),
                            "a write to a: bytes changed that it may not write to (1 bytes");
    b.bytes()[64] ^= 1;
    EXPECT_NONFATAL_FAILURE(gpu().arena()->expectIntact("a write behind b"), "a write behind b");
    EXPECT_FALSE(b.intact());
    b.bytes()[64] ^= 1;
}

} // namespace
