// SPDX-License-Identifier: Apache-2.0
// Cells on memory that the host may only write while nothing on the same page is in use.
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

constexpr uintptr_t kPage = StructureDescriptorPool::kPageBytes;

class StructureDescriptorPools : public ::testing::Test
{
protected:
    // As the device: all words of a descriptor.
    void write(uint32_t descriptor, uint32_t value) { std::fill_n(pool_.words(descriptor), kDescriptorWords, value); }
    [[nodiscard]] bool holds(uint32_t descriptor, uint32_t value) const
    {
        return std::count(pool_.words(descriptor), pool_.words(descriptor) + kDescriptorWords, value) ==
               kDescriptorWords;
    }
    static uintptr_t pageOf(const uint32_t *words) { return reinterpret_cast<uintptr_t>(words) / kPage; }

    const vellum::test::MemoryDevice device_;
    const GpuContext &context_ = device_.context();
    StructureDescriptorPool pool_;
};

// The host has written to a page if descriptors that were in use before are of zeroes again.
TEST_F(StructureDescriptorPools, WritesOnlyPagesWithoutDescriptorsInUse)
{
    std::vector<uint32_t> live;
    uint32_t random = 1;
    for (int step = 0; step < 20000; ++step) {
        random = random * 1664525u + 1013904223u;
        if (live.empty() || (random >> 16) % 100 < (step / 2500 % 2 == 0 ? 70u : 30u)) {
            // What is given out is of zeroes, and what is in use beside it is as it was.
            const uint32_t descriptor = pool_.acquire(context_);
            ASSERT_NE(descriptor, StructureDescriptorPool::kNone);
            ASSERT_TRUE(holds(descriptor, 0)) << "step " << step;
            for (const uint32_t other : live) {
                ASSERT_NE(other, descriptor);
                if (pageOf(pool_.words(other)) == pageOf(pool_.words(descriptor))) {
                    ASSERT_TRUE(holds(other, other + 1)) << "step " << step;
                }
            }
            write(descriptor, descriptor + 1);
            live.push_back(descriptor);
        } else {
            const size_t i = (random >> 8) % live.size();
            pool_.release(live[i]);
            live[i] = live.back();
            live.pop_back();
        }
    }
    for (const uint32_t descriptor : live)
        EXPECT_TRUE(holds(descriptor, descriptor + 1));
}

TEST_F(StructureDescriptorPools, KeepsDescriptorsReservedWhileTheirPageIsInUse)
{
    const uint32_t first = pool_.acquire(context_);
    const uint32_t kept = pool_.acquire(context_);
    ASSERT_EQ(pageOf(pool_.words(first)), pageOf(pool_.words(kept)));
    pool_.release(first);
    std::set<uint32_t> others;
    for (int i = 0; i < 10000; ++i)
        others.insert(pool_.acquire(context_));
    EXPECT_EQ(others.size(), 10000u);
    EXPECT_FALSE(others.contains(first));
    // And then it is: memory does not grow for ever.
    pool_.release(kept);
    for (const uint32_t descriptor : others)
        pool_.release(descriptor);
    const long allocations = vellum::test::MemoryDevice::alive();
    for (int round = 0; round < 5; ++round) {
        std::vector<uint32_t> descriptors;
        for (int i = 0; i < 10000; ++i)
            descriptors.push_back(pool_.acquire(context_));
        for (const uint32_t descriptor : descriptors)
            pool_.release(descriptor);
    }
    EXPECT_EQ(vellum::test::MemoryDevice::alive(), allocations);
}

} // namespace
