// SPDX-License-Identifier: Apache-2.0
// Descriptors in memory that either the device or the host writes, and that is used again.
#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/records.h"
#include "layer/state/structure_descriptor_pool.h"
#include "memory_device.h"

namespace
{

using namespace vellum::layer;
using namespace vellum::shared;
using Writer = StructureDescriptorPool::Writer;

class StructureDescriptorPools : public ::testing::Test
{
protected:
    // Writes all words of a descriptor, as the device or the host does. The kind is not 0.
    static void write(StructureDescriptorPool &pool, uint32_t descriptor)
    {
        uint32_t *words = pool.words(descriptor);
        std::fill_n(words, kDescriptorWords, ~descriptor); // not a kind
        words[2] = kDescriptorBottom | generation(pool, descriptor) << kDescriptorGenerationShift;
    }
    static bool holds(const StructureDescriptorPool &pool, uint32_t descriptor)
    {
        const uint32_t *words = pool.words(descriptor);
        return std::count(words, words + kDescriptorWords, ~descriptor) == kDescriptorWords - 1 &&
               states(pool, descriptor);
    }
    static uint32_t generation(const StructureDescriptorPool &pool, uint32_t descriptor)
    {
        return static_cast<uint32_t>(pool.location(descriptor).address % kDescriptorGenerations);
    }
    // Reads a descriptor as shaders do (loadDescriptor).
    static bool states(const StructureDescriptorPool &pool, uint32_t descriptor)
    {
        const uint32_t kind = pool.words(descriptor)[2];
        return kind >> kDescriptorGenerationShift == generation(pool, descriptor) &&
               (kind & kDescriptorKindMask) != kDescriptorUnbuilt;
    }

    const vellum::test::MemoryDevice device_;
    const GpuContext &context_ = device_.context();
};

TEST_F(StructureDescriptorPools, UsedOnesStayAndNewOnesStateNothing)
{
    for (const Writer writer : {Writer::Device, Writer::Host}) {
        StructureDescriptorPool pool(writer);
        std::vector<uint32_t> live;
        std::set<uint32_t> inUse;
        uint32_t random = 1;
        for (int step = 0; step < 20000; ++step) {
            random = random * 1664525u + 1013904223u;
            if (live.empty() || (random >> 16) % 100 < (step / 2500 % 2 == 0 ? 70u : 30u)) {
                const uint32_t descriptor = pool.acquire(context_);
                ASSERT_NE(descriptor, StructureDescriptorPool::kNone);
                ASSERT_TRUE(inUse.insert(descriptor).second);
                ASSERT_FALSE(states(pool, descriptor)) << "step " << step;
                if (writer == Writer::Host) {
                    ASSERT_EQ(std::count(pool.words(descriptor), pool.words(descriptor) + kDescriptorWords, 0u),
                              kDescriptorWords);
                    ASSERT_EQ(generation(pool, descriptor), 0u);
                }
                write(pool, descriptor);
                live.push_back(descriptor);
            } else {
                const size_t i = (random >> 8) % live.size();
                ASSERT_TRUE(holds(pool, live[i])) << "step " << step;
                pool.release(live[i]);
                inUse.erase(live[i]);
                live[i] = live.back();
                live.pop_back();
            }
        }
        for (const uint32_t descriptor : live)
            EXPECT_TRUE(holds(pool, descriptor));
    }
}

// Whatever lives next to them: one long-lived structure in a thousand keeps no other descriptor from being reused.
TEST_F(StructureDescriptorPools, ReleasedOnesAreReused)
{
    StructureDescriptorPool pool(Writer::Device);
    std::vector<uint32_t> longLived, others;
    for (int i = 0; i < 20000; ++i)
        (i % 100 == 0 ? longLived : others).push_back(pool.acquire(context_));
    const long allocations = vellum::test::MemoryDevice::alive();
    for (int round = 0; round < 50; ++round) { // more than there are generations
        for (const uint32_t descriptor : others) {
            write(pool, descriptor);
            pool.release(descriptor);
        }
        for (uint32_t &descriptor : others) {
            descriptor = pool.acquire(context_);
            ASSERT_FALSE(states(pool, descriptor));
        }
    }
    EXPECT_EQ(vellum::test::MemoryDevice::alive(), allocations);
}

// A capture tool may write back whole pages that the host has written to.
TEST_F(StructureDescriptorPools, TheHostDoesNotWriteToThoseOfTheDevice)
{
    StructureDescriptorPool pool(Writer::Device);
    const uint32_t descriptor = pool.acquire(context_);
    write(pool, descriptor);
    const std::vector<uint32_t> before(pool.words(descriptor), pool.words(descriptor) + kDescriptorWords);
    pool.release(descriptor);
    ASSERT_EQ(pool.acquire(context_), descriptor);
    EXPECT_EQ(std::vector<uint32_t>(pool.words(descriptor), pool.words(descriptor) + kDescriptorWords), before);
}

} // namespace
