// Cells on memory that the host may only write while nothing on the same page is in use.
#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/records.h"
#include "layer/objects/cell_pool.h"
#include "memory_device.h"

namespace
{

using namespace vellum::layer;
using namespace vellum::shared;

constexpr uintptr_t kPage = 4096;

class CellPools : public ::testing::Test
{
protected:
    // As the device: all words of a cell.
    void write(uint32_t cell, uint32_t value) { std::fill_n(pool_.words(cell), kCellWords, value); }
    [[nodiscard]] bool holds(uint32_t cell, uint32_t value) const
    {
        return std::count(pool_.words(cell), pool_.words(cell) + kCellWords, value) == kCellWords;
    }
    static uintptr_t pageOf(const uint32_t *words) { return reinterpret_cast<uintptr_t>(words) / kPage; }

    const vellum::test::MemoryDevice device_;
    const GpuContext &context_ = device_.context();
    CellPool pool_;
};

// The host has written to a page if cells that were in use before are of zeroes again.
TEST_F(CellPools, PagesAreOnlyWrittenWhileNoneOfTheirCellsIsInUse)
{
    std::vector<uint32_t> live;
    uint32_t random = 1;
    for (int step = 0; step < 20000; ++step) {
        random = random * 1664525u + 1013904223u;
        if (live.empty() || (random >> 16) % 100 < (step / 2500 % 2 == 0 ? 70u : 30u)) {
            // What is given out is of zeroes, and what is in use beside it is as it was.
            const uint32_t cell = pool_.acquire(context_);
            ASSERT_NE(cell, CellPool::kNone);
            ASSERT_TRUE(holds(cell, 0)) << "step " << step;
            for (const uint32_t other : live) {
                ASSERT_NE(other, cell);
                if (pageOf(pool_.words(other)) == pageOf(pool_.words(cell))) {
                    ASSERT_TRUE(holds(other, other + 1)) << "step " << step;
                }
            }
            write(cell, cell + 1);
            live.push_back(cell);
        } else {
            const size_t i = (random >> 8) % live.size();
            pool_.release(live[i]);
            live[i] = live.back();
            live.pop_back();
        }
    }
    for (const uint32_t cell : live)
        EXPECT_TRUE(holds(cell, cell + 1));
}

TEST_F(CellPools, ACellIsNotGivenOutAgainWhileItsPageIsInUse)
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
    for (const uint32_t cell : others)
        pool_.release(cell);
    const long allocations = vellum::test::MemoryDevice::alive();
    for (int round = 0; round < 5; ++round) {
        std::vector<uint32_t> cells;
        for (int i = 0; i < 10000; ++i)
            cells.push_back(pool_.acquire(context_));
        for (const uint32_t cell : cells)
            pool_.release(cell);
    }
    EXPECT_EQ(vellum::test::MemoryDevice::alive(), allocations);
}

} // namespace
