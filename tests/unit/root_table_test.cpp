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

} // namespace
