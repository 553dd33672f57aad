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
    if (const auto known = places_.find(key); known != places_.end()) {
        ++known->second.users;
        return known->second.place;
    }
    return places_.emplace(key, Entry{std::make_shared<StructurePlace>(root_), 1}).first->second.place;
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
