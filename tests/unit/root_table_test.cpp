// SPDX-License-Identifier: Apache-2.0
// The tables that shaders reach by addresses, which other threads read while they grow.
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "layer/state/root_table.h"
#include "memory_device.h"

namespace
{

using namespace vellum::layer;

// One thread creates shader modules, which contain the address, while another records builds of top-level structures.
TEST(RootTables, TheAddressOfTheFirstSlotsStaysWhilePagesAreAdded)
{
    const vellum::test::MemoryDevice device;
    for (int round = 0; round < 20; ++round) {
        RootTable table;
        ASSERT_EQ(table.create(device.context()), VK_SUCCESS);
        const VkDeviceAddress address = table.firstSlots();
        std::atomic<bool> growing = true;
        std::thread builder([&] {
            std::vector<std::shared_ptr<SlotRange>> slots;
            for (int page = 0; page < 9; ++page)
                slots.push_back(table.allocateSlots(1u << 16));
            growing = false;
        });
        uint64_t others = 0;
        while (growing)
            others += table.firstSlots() != address;
        builder.join();
        EXPECT_EQ(others, 0u);
    }
}

// Instances are written page by page, each with the address of its own record.
TEST(RootTables, RecordsOfSlotsOnSeveralPages)
{
    const vellum::test::MemoryDevice device;
    RootTable table;
    ASSERT_EQ(table.create(device.context()), VK_SUCCESS);
    constexpr uint32_t kPage = vellum::shared::kSlotsPerPage;
    const auto first = table.allocateSlots(kPage - 10);
    const auto second = table.allocateSlots(kPage + 20); // the end of one page, another page, the beginning of a third
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->recordAddress(7), table.firstSlots() + 7 * 16);
    ASSERT_EQ(second->first(), kPage - 10);
    EXPECT_EQ(second->recordAddress(kPage - 1), table.firstSlots() + (kPage - 1) * 16);
    EXPECT_EQ(second->recordAddress(kPage + 5), second->recordAddress(kPage) + 5 * 16);
    EXPECT_NE(second->recordAddress(kPage), second->recordAddress(2 * kPage));
    EXPECT_EQ(second->recordAddress(2 * kPage + 9), second->recordAddress(2 * kPage) + 9 * 16);
}

} // namespace
