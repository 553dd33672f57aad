// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/address_map.h"

#include <algorithm>
#include <bit>
#include <mutex>
#include <utility>

#include "layer/base/undo.h"

namespace vellum::layer
{

template <typename Visit>
void AddressMap::visit(VkDeviceAddress address, VkDeviceAddress end, Visit visit) const
{
    for (const auto &[least, ranges] : classes_) {
        for (auto it = ranges.lower_bound(end); it != ranges.begin();) {
            const auto &[begin, range] = *--it;
            if (begin <= address && (address - begin) / 2 >= least)
                break;
            if (range.end > std::max(begin, address) && visit(begin, range))
                return;
        }
    }
}

void AddressMap::add(VkDeviceAddress address, VkBuffer buffer, VkDeviceSize size, VkFlags64 usage, Owner owner)
{
    if (address == 0)
        return;
    std::unique_lock lock(mutex_);
    const auto [known, isNew] = known_.try_emplace(buffer);
    if (!isNew)
        return;
    Undo undo([&] { known_.erase(buffer); });
    Ranges &ranges = classes_[std::bit_floor(size)];
    known->second = {&ranges, ranges.insert({address, {buffer, address + size, usage, std::move(owner)}})};
    undo.keep();
}

AddressMap::Owner AddressMap::remove(VkBuffer buffer)
{
    std::unique_lock lock(mutex_);
    const auto known = known_.extract(buffer);
    if (!known)
        return nullptr;
    const auto [ranges, range] = known.mapped();
    Owner owner = std::move(range->second.owner);
    ranges->erase(range);
    return owner;
}

void AddressMap::hide(VkBuffer buffer)
{
    std::unique_lock lock(mutex_);
    if (const auto known = known_.find(buffer); known != known_.end())
        known->second.range->second.end = known->second.range->first;
}

AddressMap::Location AddressMap::find(VkDeviceAddress address, VkFlags64 usage) const
{
    std::shared_lock lock(mutex_);
    Location location;
    visit(address, address + 1, [&](VkDeviceAddress begin, const Range &range) {
        if (range.end - address > location.bytes && (range.usage & usage) == usage)
            location = locationOf(begin, range, address);
        return false;
    });
    return location;
}

VkDeviceAddress AddressMap::addressOf(VkBuffer buffer) const
{
    std::shared_lock lock(mutex_);
    const auto known = known_.find(buffer);
    return known == known_.end() ? 0 : known->second.range->first;
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
    visit(address, address + 1, [&](VkDeviceAddress begin, const Range &range) {
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
    visit(address, address + 1, [&](VkDeviceAddress, const Range &range) {
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
    visit(address, end, [&](VkDeviceAddress begin, const Range &range) {
        const bool alone = !only.buffer && begin <= address && range.end >= end;
        only = alone ? Only{range.buffer, range.usage} : Only{};
        return !alone;
    });
    return only;
}

std::vector<AddressMap::Location> AddressMap::within(VkDeviceAddress address, VkDeviceSize size) const
{
    std::shared_lock lock(mutex_);
    std::vector<Location> locations;
    const VkDeviceAddress end = size > UINT64_MAX - address ? UINT64_MAX : address + size;
    visit(address, end, [&](VkDeviceAddress begin, const Range &range) {
        const VkDeviceAddress first = std::max(begin, address);
        if (first < end)
            locations.push_back({range.buffer, first - begin, std::min(range.end, end) - first, range.owner});
        return false;
    });
    return locations;
}

} // namespace vellum::layer
