// SPDX-License-Identifier: Apache-2.0
// The map from addresses to buffers, against one that looks at every buffer.
#include <algorithm>
#include <ctime>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "layer/memory/address_map.h"

namespace
{

using vellum::layer::AddressMap;

VkBuffer bufferHandle(uint64_t value)
{
    return reinterpret_cast<VkBuffer>(value);
}

struct Known {
    VkBuffer buffer;
    VkDeviceAddress begin;
    VkDeviceSize size;
    VkFlags64 usage;
    [[nodiscard]] VkDeviceAddress end() const { return begin + size; }
};

class Model
{
public:
    void add(const Known &known)
    {
        map_.add(known.begin, known.buffer, known.size, known.usage);
        all_.push_back(known);
    }
    void remove(size_t i, bool hideOnly)
    {
        if (hideOnly)
            map_.hide(all_[i].buffer);
        else
            map_.remove(all_[i].buffer);
        all_.erase(all_.begin() + static_cast<ptrdiff_t>(i));
    }
    [[nodiscard]] size_t count() const { return all_.size(); }

    void expectFind(VkDeviceAddress address) const
    {
        VkDeviceSize furthest = 0;
        for (const Known &k : all_) {
            if (k.begin <= address && address < k.end())
                furthest = std::max(furthest, k.end() - address);
        }
        const AddressMap::Location location = map_.find(address);
        ASSERT_EQ(location.bytes, furthest);
        ASSERT_EQ(location.buffer != VK_NULL_HANDLE, furthest != 0);
        ASSERT_EQ(map_.bytesFrom(address), furthest == 0 ? UINT64_MAX : furthest);
        if (furthest != 0) {
            expectIn(location, address);
        }
    }
    void expectCovering(VkDeviceAddress address, VkDeviceSize size, VkFlags64 usage) const
    {
        const bool any =
            std::any_of(all_.begin(), all_.end(), [&](const Known &k) { return fits(k, address, size, usage); });
        const AddressMap::Location location = map_.covering(address, size, usage);
        ASSERT_EQ(location.buffer != VK_NULL_HANDLE, any);
        if (any) {
            const Known &k = expectIn(location, address);
            ASSERT_TRUE(fits(k, address, size, usage));
        }
        const auto containing =
            std::count_if(all_.begin(), all_.end(), [&](const Known &k) { return fits(k, address, size, 0); });
        ASSERT_EQ(map_.onlyCovering(address, size),
                  containing == 1 ? map_.covering(address, size, 0).buffer : VK_NULL_HANDLE);
    }
    void expectWithin(VkDeviceAddress address, VkDeviceSize size) const
    {
        std::vector<AddressMap::Location> locations = map_.within(address, size);
        for (const Known &k : all_) {
            const VkDeviceAddress begin = std::max(k.begin, address);
            const VkDeviceAddress end = std::min(k.end(), address + size);
            const auto it =
                std::find_if(locations.begin(), locations.end(), [&](const auto &p) { return p.buffer == k.buffer; });
            ASSERT_EQ(it != locations.end(), begin < end);
            if (begin >= end)
                continue;
            ASSERT_EQ(it->offset, begin - k.begin);
            ASSERT_EQ(it->bytes, end - begin);
            locations.erase(it);
        }
        ASSERT_TRUE(locations.empty());
    }

private:
    static bool fits(const Known &k, VkDeviceAddress address, VkDeviceSize size, VkFlags64 usage)
    {
        return k.begin <= address && address < k.end() && address + size <= k.end() && (k.usage & usage) == usage;
    }
    const Known &expectIn(const AddressMap::Location &location, VkDeviceAddress address) const
    {
        const auto it =
            std::find_if(all_.begin(), all_.end(), [&](const Known &k) { return k.buffer == location.buffer; });
        EXPECT_NE(it, all_.end());
        EXPECT_EQ(it->begin + location.offset, address);
        EXPECT_EQ(it->end() - address, location.bytes);
        return *it;
    }

    AddressMap map_;
    std::vector<Known> all_;
};

// Few addresses and many buffers, so that they overlap, begin and end together, and leave gaps.
TEST(AddressMap, AgreesWithALookAtEveryBuffer)
{
    std::mt19937 random(1);
    const auto upTo = [&random](uint32_t most) { return random() % (most + 1); };
    for (int run = 0; run < 40; ++run) {
        Model model;
        for (uint64_t step = 1; step <= 60; ++step) {
            if (model.count() > 0 && upTo(2) == 0)
                model.remove(upTo(static_cast<uint32_t>(model.count() - 1)), upTo(1) == 0);
            else
                model.add({bufferHandle(step), 1 + upTo(60), 1 + upTo(upTo(1) ? 4 : 40), upTo(7)});
            for (int look = 0; look < 20; ++look) {
                model.expectFind(upTo(110));
                model.expectCovering(upTo(110), upTo(20), upTo(7));
                model.expectWithin(upTo(110), upTo(30));
                if (HasFatalFailure())
                    return;
            }
        }
    }
}

// A buffer over all memory, as allocators have it, aliases many others. Before, a look-up took 500 times as long with
// it.
TEST(AddressMap, ABufferOverAllOthers)
{
    constexpr uint64_t kBuffers = 20000, kBytes = 65536, kFirst = uint64_t{1} << 40;
    AddressMap map;
    for (uint64_t i = 0; i < kBuffers; ++i)
        map.add(kFirst + i * kBytes, bufferHandle(i + 2), kBytes, 0);
    const auto processorTime = [&map] {
        const std::clock_t start = std::clock();
        for (uint64_t i = 0; i < kBuffers; ++i)
            EXPECT_NE(map.find(kFirst + i * 7919 % kBuffers * kBytes + 64).buffer, bufferHandle(0));
        return std::clock() - start;
    };
    const std::clock_t alone = processorTime();
    map.add(kFirst, bufferHandle(1), kBuffers * kBytes, 0);
    EXPECT_LT(processorTime(), 50 * (alone + 1));
}

TEST(AddressMap, RangesThatWouldWrapAreInNoBuffer)
{
    AddressMap map;
    map.add(0x1000, bufferHandle(1), 0x100, 0);
    EXPECT_EQ(map.covering(0x1010, UINT64_MAX, 0).buffer, bufferHandle(0));
    EXPECT_EQ(map.covering(0x1010, UINT64_MAX - 0x100f, 0).buffer, bufferHandle(0));
    EXPECT_EQ(map.covering(0x1000, 0x100, 0).buffer, bufferHandle(1));
    EXPECT_EQ(map.covering(0x1000, 0x101, 0).buffer, bufferHandle(0));
    EXPECT_EQ(map.within(0x10f0, UINT64_MAX).size(), 1u);
}

// The memory of a buffer is freed before the buffer is destroyed.
TEST(AddressMap, HiddenBuffersKeepTheirOwner)
{
    AddressMap map;
    // The map never dereferences the owned handle.
    const AddressMap::Owner owner(reinterpret_cast<vellum::layer::DriverBuffer *>(1), [](auto *) {});
    map.add(0x1000, bufferHandle(1), 0x100, 0, owner);
    map.hide(bufferHandle(1));
    map.hide(bufferHandle(2));
    map.add(0x1000, bufferHandle(3), 0x80, 0);
    EXPECT_EQ(map.find(0x1000).buffer, bufferHandle(3));
    EXPECT_EQ(map.find(0x1080).buffer, bufferHandle(0));
    EXPECT_EQ(map.remove(bufferHandle(1)), owner);
    EXPECT_EQ(map.find(0x1000).buffer, bufferHandle(3));
}

TEST(AddressMap, AddressZeroIsNoAddress)
{
    AddressMap map;
    map.add(0, bufferHandle(1), 0x100, 0);
    EXPECT_EQ(map.find(0).buffer, bufferHandle(0));
    map.remove(bufferHandle(1));
    map.remove(bufferHandle(2));
}

} // namespace
