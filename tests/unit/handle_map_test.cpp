// SPDX-License-Identifier: Apache-2.0
#include "layer/base/handle_map.h"

#include <gtest/gtest.h>

namespace
{

// Counts comparisons: what a look-up in a hash table costs.
struct Handle {
    uint64_t bits = 0;
    explicit operator uintptr_t() const { return static_cast<uintptr_t>(bits); }
    bool operator==(const Handle &other) const
    {
        ++comparisons;
        return bits == other.bits;
    }
    static inline uint64_t comparisons = 0;
};

} // namespace

template <>
struct std::hash<Handle> {
    size_t operator()(Handle handle) const noexcept { return handle.bits; }
};

namespace
{

using vellum::layer::HandleMap;

constexpr uint64_t kHandles = 8192;

Handle handle(uint64_t i)
{
    return {0x55000000 + i * 0x150}; // like addresses of objects on the heap
}

// The mean number of comparisons for one look-up.
double comparisonsPerLookUp(const HandleMap<Handle, uint64_t> &map)
{
    Handle::comparisons = 0;
    for (uint64_t i = 0; i < kHandles; ++i)
        EXPECT_EQ(map.get(handle(i)), i + 1);
    return static_cast<double>(Handle::comparisons) / kHandles;
}

TEST(HandleMaps, LookUpsCostTheSameWithManyHandles)
{
    HandleMap<Handle, uint64_t> byValue, byEntry;
    for (uint64_t i = 0; i < kHandles; ++i) {
        byValue.set(handle(i), i + 1);
        byEntry.set(handle(i), byEntry.entry(i + 1));
    }
    EXPECT_LT(comparisonsPerLookUp(byValue), 4);
    EXPECT_LT(comparisonsPerLookUp(byEntry), 4);
}

TEST(HandleMaps, EntriesReplaceAndLeave)
{
    HandleMap<Handle, uint64_t> map;
    map.set(handle(1), map.entry(10));
    map.set(handle(1), map.entry(11));
    EXPECT_EQ(map.get(handle(1)), 11u);
    EXPECT_EQ(map.take(handle(1)), 11u);
    EXPECT_EQ(map.get(handle(1)), 0u);
}

} // namespace
