// SPDX-License-Identifier: Apache-2.0
// The buffers at device addresses: every buffer whose address the application has queried, and with
// VK_KHR_device_address_commands every buffer that has an address.
#pragma once

#include <map>
#include <memory>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

class DriverBuffer; // memory/buffers.cpp

class AddressMap
{
public:
    using Owner = std::shared_ptr<DriverBuffer>;
    // `usage`: the flags that the driver got. `owner`: null if the locations that are found are never passed to the
    // driver. Address 0 and buffers that are known already are ignored.
    void add(VkDeviceAddress address, VkBuffer buffer, VkDeviceSize size, VkFlags64 usage, Owner owner = {});
    // Returns the owner; null also for a buffer that is not known.
    Owner remove(VkBuffer buffer);
    // Searches no longer find the buffer, whose memory is freed. It keeps its owner until remove().
    void hide(VkBuffer buffer);
    struct Location {
        VkBuffer buffer = VK_NULL_HANDLE; // null if there is none
        VkDeviceSize offset = 0;
        VkDeviceSize bytes = 0; // to the end of the buffer
        Owner owner{};          // keeps the driver's buffer, which the application may destroy
    };
    // The buffer at an address with all usage flags; of several, the one with the furthest end, which bounds what the
    // GPU may read.
    [[nodiscard]] Location find(VkDeviceAddress address, VkFlags64 usage = 0) const;
    // The address of a buffer; 0 if it is unknown, for example without memory.
    [[nodiscard]] VkDeviceAddress addressOf(VkBuffer buffer) const;
    // Bytes from `address` to the end of its buffer; UINT64_MAX if no buffer is known there.
    [[nodiscard]] VkDeviceSize bytesFrom(VkDeviceAddress address) const;
    // The number of elements of `bytes` bytes, `stride` apart, between `address` and the end of its buffer; at most
    // UINT32_MAX.
    [[nodiscard]] uint32_t elementsFrom(VkDeviceAddress address, VkDeviceSize bytes, VkDeviceSize stride) const;
    // A buffer that contains the whole range and has all usage flags. Buffers may alias each other in memory, and so in
    // addresses. The one that the application got an address from is unknown, and any that fits will do, as long as its
    // owner is kept.
    [[nodiscard]] Location covering(VkDeviceAddress address, VkDeviceSize size, VkFlags64 usage) const;
    // The buffer that contains the whole range, if no other does; otherwise null.
    [[nodiscard]] VkBuffer onlyCovering(VkDeviceAddress address, VkDeviceSize size) const;
    // The buffer that contains the whole range, if no other buffer has a part of it; otherwise null.
    struct Only {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkFlags64 usage = 0;
    };
    [[nodiscard]] Only only(VkDeviceAddress address, VkDeviceSize size) const;
    // The parts of a range in every buffer: offset in the buffer, and bytes.
    [[nodiscard]] std::vector<Location> within(VkDeviceAddress address, VkDeviceSize size) const;

private:
    struct Range {
        VkBuffer buffer;
        VkDeviceAddress end;
        VkFlags64 usage;
        Owner owner;
    };
    static Location locationOf(VkDeviceAddress begin, const Range &range, VkDeviceAddress address)
    {
        return {range.buffer, address - begin, range.end - address, range.owner};
    }
    using Ranges = std::multimap<VkDeviceAddress, Range>; // by their begin
    struct Known {
        Ranges *ranges = nullptr;
        Ranges::iterator range;
    };
    // Calls `visit(begin, range)` for every range that has bytes from `address` on and begins before `end`, until it
    // returns true. Of smaller buffers first.
    template <typename Visit>
    void visit(VkDeviceAddress address, VkDeviceAddress end, Visit visit) const;

    mutable std::shared_mutex mutex_;
    // By the power of two that their size is not below. One that begins further before an address than twice as much
    // does not reach it, so a search passes few of them, even if a buffer over all memory aliases many others.
    std::map<VkDeviceSize, Ranges> classes_;
    std::unordered_map<VkBuffer, Known> known_;
};

} // namespace vellum::layer
