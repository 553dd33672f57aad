// SPDX-License-Identifier: Apache-2.0
#include "layer/state/structure_location.h"

namespace vellum::layer
{

StructureLocation::~StructureLocation()
{
    for (const Reference &reference : references)
        root.releaseDescriptor(reference.address);
    if (heldKey != 0)
        root.releaseDescriptor(heldKey);
}

std::shared_ptr<StructureLocation> StructureLocations::acquire(const Key &key)
{
    std::lock_guard lock(mutex_);
    if (const auto known = locations_.find(key); known != locations_.end()) {
        ++known->second.users;
        return known->second.location;
    }
    return locations_.emplace(key, Entry{std::make_shared<StructureLocation>(root_), 1}).first->second.location;
}

void StructureLocations::release(const Key &key)
{
    std::lock_guard lock(mutex_);
    const auto it = locations_.find(key);
    if (it != locations_.end() && --it->second.users == 0)
        locations_.erase(it);
}

VkDeviceSize StructureLocations::bytesToNext(const Key &key) const
{
    std::lock_guard lock(mutex_);
    const auto next = locations_.upper_bound(key);
    return next == locations_.end() || next->first.first != key.first ? ~VkDeviceSize{0}
                                                                      : next->first.second - key.second;
}

} // namespace vellum::layer
