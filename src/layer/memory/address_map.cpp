// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/address_map.h"

#include <algorithm>
#include <iterator>
#include <mutex>
#include <utility>

#include "layer/base/undo.h"

namespace vellum::layer
{

// Buffers rarely overlap, so an insertion or removal changes the reach of few ranges, mostly of none.
void AddressMap::updateReach(Ranges::iterator from)
{
    VkDeviceAddress reach = from == ranges_.begin() ? 0 : std::prev(from)->second.reach;
    for (auto it = from; it != ranges_.end(); ++it) {
        reach = std::max(reach, it->second.end);
        if (it->second.reach == reach)
            return;
        it->second.reach = reach;
    }
}

template <typename Visit>
void AddressMap::visitAt(VkDeviceAddress address, Visit visit) const
{
    for (auto it = ranges_.upper_bound(address); it != ranges_.begin();) {
        --it;
        if (it->second.reach <= address || (it->second.end > address && visit(it->first, it->second)))
            return;
    }
}

void AddressMap::add(VkDeviceAddress address, VkBuffer buffer, VkDeviceSize size, VkFlags64 usage, Owner owner)
{
    if (address == 0)
        return;
    std::unique_lock lock(mutex_);
    if (!addresses_.emplace(buffer, address).second)
        return;
    Undo undo([&] { addresses_.erase(buffer); });
    updateReach(ranges_.insert({address, {buffer, address + size, usage, 0, std::move(owner)}}));
    undo.keep();
}

AddressMap::Ranges::iterator AddressMap::rangeOf(VkBuffer buffer)
{
    const auto known = addresses_.find(buffer);
    if (known == addresses_.end())
        return ranges_.end();
    const auto [first, last] = ranges_.equal_range(known->second);
    return std::find_if(first, last, [buffer](const auto &range) { return range.second.buffer == buffer; });
}

AddressMap::Owner AddressMap::remove(VkBuffer buffer)
{
    std::unique_lock lock(mutex_);
    const auto it = rangeOf(buffer);
    if (it == ranges_.end())
        return nullptr;
    Owner owner = std::move(it->second.owner);
    updateReach(ranges_.erase(it));
    addresses_.erase(buffer);
    return owner;
}

void AddressMap::hide(VkBuffer buffer)
{
    std::unique_lock lock(mutex_);
    const auto it = rangeOf(buffer);
    if (it == ranges_.end())
        return;
    it->second.end = it->first;
    updateReach(it);
}

AddressMap::Location AddressMap::find(VkDeviceAddress address, VkFlags64 usage) const
{
    std::shared_lock lock(mutex_);
    Location location;
    visitAt(address, [&](VkDeviceAddress begin, const Range &range) {
        if (range.end - address > location.bytes && (range.usage & usage) == usage)
            location = locationOf(begin, range, address);
        return false;
    });
    return location;
}

VkDeviceAddress AddressMap::addressOf(VkBuffer buffer) const
{
    std::shared_lock lock(mutex_);
    const auto known = addresses_.find(buffer);
    return known == addresses_.end() ? 0 : known->second;
}

VkDeviceSize AddressMap::bytesFrom(VkDeviceAddress address) const
{
    const Location location = find(address);
    return location.buffer ? location.bytes : UINT64_MAX;
}

uint32_t AddressMap::elementsFrom(VkDeviceAddress address, VkDeviceSize bytes, VkDeviceSize stride) const
{
    const VkDeviceSize readable = bytesFrom(address);
    if (readable < bytes)
        return 0;
    return stride == 0 ? UINT32_MAX
                       : static_cast<uint32_t>(std::min<VkDeviceSize>((readable - bytes) / stride, UINT32_MAX - 1)) + 1;
}

AddressMap::Location AddressMap::covering(VkDeviceAddress address, VkDeviceSize size, VkFlags64 usage) const
{
    std::shared_lock lock(mutex_);
    Location location;
    visitAt(address, [&](VkDeviceAddress begin, const Range &range) {
        if (range.end - address < size || (range.usage & usage) != usage)
            return false;
        location = locationOf(begin, range, address);
        return true;
    });
    return location;
}

VkBuffer AddressMap::onlyCovering(VkDeviceAddress address, VkDeviceSize size) const
{
    std::shared_lock lock(mutex_);
    VkBuffer buffer = VK_NULL_HANDLE;
    uint32_t buffers = 0;
    visitAt(address, [&](VkDeviceAddress, const Range &range) {
        if (range.end - address < size)
            return false;
        buffer = range.buffer;
        return ++buffers == 2;
    });
    return buffers == 1 ? buffer : VK_NULL_HANDLE;
}

AddressMap::Only AddressMap::only(VkDeviceAddress address, VkDeviceSize size) const
{
    std::shared_lock lock(mutex_);
    const VkDeviceAddress end = size > UINT64_MAX - address ? UINT64_MAX : address + size;
    Only only;
    for (auto it = ranges_.lower_bound(end); it != ranges_.begin();) {
        --it;
        if (it->second.reach <= address)
            break;
        if (it->second.end <= address)
            continue;
        if (only.buffer || it->first > address || it->second.end < end)
            return {};
        only = {it->second.buffer, it->second.usage};
    }
    return only;
}

std::vector<AddressMap::Location> AddressMap::within(VkDeviceAddress address, VkDeviceSize size) const
{
    std::shared_lock lock(mutex_);
    std::vector<Location> locations;
    const VkDeviceAddress end = size > UINT64_MAX - address ? UINT64_MAX : address + size;
    for (auto it = ranges_.lower_bound(end); it != ranges_.begin();) {
        --it;
        if (it->second.reach <= address)
            break;
        const VkDeviceAddress begin = std::max(it->first, address);
        const VkDeviceAddress last = std::min(it->second.end, end);
        if (begin < last)
            locations.push_back({it->second.buffer, begin - it->first, last - begin, it->second.owner});
    }
    return locations;
}

} // namespace vellum::layer
