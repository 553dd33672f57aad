#include "layer/objects/structure_place.h"

namespace vellum::layer
{

StructurePlace::~StructurePlace()
{
    for (const Reference &reference : references)
        root.releaseCell(reference.address);
    if (heldKey != 0)
        root.releaseCell(heldKey);
}

std::shared_ptr<StructurePlace> StructurePlaces::acquire(const Key &key)
{
    std::lock_guard lock(mutex_);
    Entry &entry = places_[key];
    if (!entry.place)
        entry.place = std::make_shared<StructurePlace>(root_);
    ++entry.users;
    return entry.place;
}

void StructurePlaces::release(const Key &key)
{
    std::lock_guard lock(mutex_);
    const auto it = places_.find(key);
    if (it != places_.end() && --it->second.users == 0)
        places_.erase(it);
}

VkDeviceSize StructurePlaces::bytesToNext(const Key &key) const
{
    std::lock_guard lock(mutex_);
    const auto next = places_.upper_bound(key);
    return next == places_.end() || next->first.first != key.first ? ~VkDeviceSize{0} : next->first.second - key.second;
}

} // namespace vellum::layer
