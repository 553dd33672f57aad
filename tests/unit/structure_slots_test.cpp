// SPDX-License-Identifier: Apache-2.0
// The instance slots of top-level structures that grow: old ones come back once nothing can access them.
#include <array>
#include <deque>
#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "core/records.h"
#include "layer/state/device_state.h"
#include "memory_device.h"

namespace
{

using namespace vellum::layer;
using namespace vellum::shared;

class StructureSlots : public testing::Test
{
protected:
    StructureSlots()
    {
        EXPECT_EQ(state_.root.create(device_.context()), VK_SUCCESS);
        enterLocation(state_, structure_);
        structure_.location->descriptor.words = words_.data();
    }
    // Simulates the execution of a build with these slots on the device.
    void execute(const SlotRange &slots)
    {
        words_[2] = kDescriptorTop;
        words_[kDescriptorFirstSlot] = slots.first();
    }
    std::shared_ptr<SlotRange> record(uint32_t count) { return slotsFor(state_, structure_, count); }

    const vellum::test::MemoryDevice device_;
    std::array<uint32_t, kDescriptorWords> words_{};
    Driver driver_;
    DeviceBuffers buffers_{driver_};
    DeviceState state_{driver_, buffers_};
    AccelerationStructure structure_;
};

// Over time, the structure has used three times as many slots as there are.
TEST_F(StructureSlots, GrowingStructuresReleaseSlots)
{
    for (uint32_t count = 1 << 16; count < 7u << 20; count += count / 4) {
        const auto slots = record(count);
        ASSERT_TRUE(slots) << count;
        ASSERT_GE(slots->count(), count);
        execute(*slots);
    }
}

TEST_F(StructureSlots, StayWhileACommandBufferUsesThem)
{
    std::weak_ptr<SlotRange> first = record(100);
    auto commands = first.lock()->use();
    execute(*record(1000));
    execute(*record(10000));
    EXPECT_FALSE(first.expired());
    commands.reset();
    (void)record(100000);
    EXPECT_TRUE(first.expired());
}

TEST_F(StructureSlots, StayWhileTheContentUsesThem)
{
    std::weak_ptr<SlotRange> first = record(100);
    execute(*first.lock());
    std::weak_ptr<SlotRange> second = record(1000); // never executed
    const auto third = record(10000);
    EXPECT_FALSE(first.expired());
    (void)record(100000);
    EXPECT_TRUE(second.expired());
    EXPECT_FALSE(first.expired());
    execute(*third);
    (void)record(1000000);
    EXPECT_TRUE(first.expired());
}

// Commands that name a destroyed structure cannot be submitted any more.
TEST_F(StructureSlots, GoWithTheStructure)
{
    std::weak_ptr<SlotRange> slots = record(100);
    const auto commands = slots.lock()->use();
    leaveLocation(state_, structure_);
    EXPECT_TRUE(slots.expired());
}

TEST_F(StructureSlots, GoWithTheLastStructureOfALocation)
{
    AccelerationStructure other;
    enterLocation(state_, other);
    EXPECT_EQ(other.location, structure_.location);
    const std::weak_ptr<SlotRange> slots = record(100);
    leaveLocation(state_, structure_);
    EXPECT_FALSE(slots.expired());
    EXPECT_EQ(other.location->first, &other);
    EXPECT_EQ(other.nextAtLocation, nullptr);
    leaveLocation(state_, other);
    EXPECT_TRUE(slots.expired());
}

// Destroyed in the order of their creation. A step for each other one would take minutes.
TEST_F(StructureSlots, ManyAtOneLocation)
{
    std::deque<AccelerationStructure> many(200'000);
    for (AccelerationStructure &structure : many)
        enterLocation(state_, structure);
    for (AccelerationStructure &structure : many)
        leaveLocation(state_, structure);
    EXPECT_EQ(structure_.location->first, &structure_);
    EXPECT_EQ(structure_.nextAtLocation, nullptr);
}

// Each thread's structures begin where those of the others do, and at the location behind.
TEST_F(StructureSlots, LocationsOfSeveralThreads)
{
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([this] {
            for (int i = 0; i < 2000; ++i) {
                AccelerationStructure own, next;
                own.size = 1024;
                next.offset = 256;
                enterLocation(state_, own);
                enterLocation(state_, next);
                EXPECT_EQ(capacityOf(state_, own), 256u);
                leaveLocation(state_, next);
                leaveLocation(state_, own);
            }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(structure_.location->first, &structure_);
    EXPECT_EQ(structure_.location->users, 1u);
    structure_.size = 1024;
    EXPECT_EQ(capacityOf(state_, structure_), 1024u);
}

} // namespace
