// SPDX-License-Identifier: Apache-2.0
#include "layer/state/structure_location.h"

#include <iterator>

namespace vellum::layer
{

StructureLocation::~StructureLocation()
{
    for (const Reference &reference : references)
        root.releaseDescriptor(reference.address);
    if (heldKey != 0)
        root.releaseDescriptor(heldKey);
}

VkDeviceSize StructureLocations::bytesToNext(Position position) const
{
    std::lock_guard lock(mutex_);
    const auto next = std::next(position);
    return next == locations_.end() || next->first.first != position->first.first
               ? ~VkDeviceSize{0}
               : next->first.second - position->first.second;
}

} // namespace vellum::layer
