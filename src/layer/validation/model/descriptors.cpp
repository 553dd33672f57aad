// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/descriptors.h"

#include <algorithm>
#include <cstring>

#include "layer/base/pnext.h"
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{
namespace
{

constexpr VkDescriptorType kStructure = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR;

// Sets descriptors from an element of a binding on. Those beyond the size of a binding are of the next one.
void setStructures(StructureSet &set, uint32_t binding, uint32_t element, const StructurePointers &structures)
{
    for (const auto &structure : structures) {
        auto at = set.bindings.find(binding);
        while (at != set.bindings.end() && element >= at->second.size) {
            element -= at->second.size;
            ++at;
            binding = at == set.bindings.end() ? binding : at->first;
        }
        StructurePointers &known = set.structures[binding];
        if (known.size() <= element)
            known.resize(element + 1);
        known[element++] = structure;
    }
}

} // namespace

DescriptorAccess::DescriptorAccess(DeviceModel &model)
    : device(model), tracker(model.objects.descriptors), lock(tracker.mutex_)
{
}

std::shared_ptr<StructureSet> DescriptorAccess::set(VkDescriptorSet handle) const
{
    const auto found = sets().find(handle);
    return found == sets().end() ? nullptr : found->second;
}

StructureTemplate DescriptorAccess::form(VkDescriptorUpdateTemplate handle) const
{
    const auto found = templates().find(handle);
    return found == templates().end() ? StructureTemplate{} : found->second;
}

std::shared_ptr<ValidatedStructure> DescriptorAccess::structure(VkAccelerationStructureKHR handle) const
{
    return handle ? device.objects.structures.get(handle) : nullptr;
}

void DescriptorAccess::removePool(VkDescriptorPool pool) const
{
    const auto known = pools().find(pool);
    if (known == pools().end())
        return;
    for (const VkDescriptorSet set : known->second)
        sets().erase(set);
    pools().erase(known);
}

void DescriptorAccess::write(StructureSet &set, const VkWriteDescriptorSet &write) const
{
    StructurePointers structures(write.descriptorCount);
    const auto *given = findInChain<VkWriteDescriptorSetAccelerationStructureKHR>(
        write.pNext, VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR);
    if (write.descriptorType == kStructure && given) {
        for (uint32_t i = 0; i < std::min(write.descriptorCount, given->accelerationStructureCount); ++i)
            structures[i] = structure(given->pAccelerationStructures[i]);
    } else if (!set.structures.contains(write.dstBinding)) {
        return; // descriptors of another type, which replace no structures
    }
    setStructures(set, write.dstBinding, write.dstArrayElement, structures);
}

void DescriptorAccess::write(StructureSet &set, const StructureTemplate &form, const void *data) const
{
    for (const VkDescriptorUpdateTemplateEntry &entry : form.entries) {
        StructurePointers structures;
        for (uint32_t i = 0; i < entry.descriptorCount; ++i) {
            const auto *at = static_cast<const std::byte *>(data) + entry.offset + i * entry.stride;
            VkAccelerationStructureKHR given;
            std::memcpy(&given, at, sizeof given); // at any offset
            structures.push_back(structure(given));
        }
        setStructures(set, entry.dstBinding, entry.dstArrayElement, structures);
    }
}

void DescriptorAccess::copy(const VkCopyDescriptorSet &copy) const
{
    const auto from = set(copy.srcSet);
    const auto to = set(copy.dstSet);
    if (!from || !to || !from->structures.contains(copy.srcBinding))
        return;
    const StructurePointers &all = from->structures[copy.srcBinding];
    StructurePointers structures(copy.descriptorCount);
    for (uint32_t i = 0; i < copy.descriptorCount && copy.srcArrayElement + i < all.size(); ++i)
        structures[i] = all[copy.srcArrayElement + i];
    setStructures(*to, copy.dstBinding, copy.dstArrayElement, structures);
}

StructurePointers DescriptorTracker::structures(const StructureSet &set, uint32_t binding,
                                                std::optional<uint32_t> element) const
{
    const std::lock_guard lock(mutex_);
    StructurePointers result;
    const auto found = set.structures.find(binding);
    if (found == set.structures.end() || (element && *element >= found->second.size()))
        return result;
    for (uint32_t i = 0; i < found->second.size(); ++i)
        if (!element || *element == i)
            result.push_back(found->second[i]);
    return result;
}

} // namespace vellum::layer
