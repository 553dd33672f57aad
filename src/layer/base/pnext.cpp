// SPDX-License-Identifier: Apache-2.0
#include "layer/base/pnext.h"

#include <algorithm>
#include <cstring>

#include "layer/base/struct_sizes.h"
#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{
namespace
{

size_t structureSize(VkStructureType type)
{
    // Structures of the loader are not in the registry; one is at the head of every VkDeviceCreateInfo chain.
    if (type == VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO || type == VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO)
        return 4 * sizeof(void *);
    if (const size_t size = registrySize(type))
        return size;
    // For registries that are older than these.
    if (type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR)
        return sizeof(VkPhysicalDeviceOpacityMicromapFeaturesKHR);
    if (type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR)
        return sizeof(VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR);
    if (type == VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR)
        return sizeof(VkAccelerationStructureTrianglesOpacityMicromapKHR);
    if (type == VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR)
        return sizeof(VkAccelerationStructureGeometryMicromapDataKHR);
    if (type == VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR)
        return sizeof(VkMemoryRangeBarriersInfoKHR);
    if (type == newer::kBufferUsageFlags2CreateInfo || type == newer::kPipelineCreateFlags2CreateInfo)
        return sizeof(newer::BufferUsageFlags2CreateInfo);
    if (type == newer::kPipelineBinaryInfo)
        return sizeof(newer::PipelineBinaryInfo);
    if (type == newer::kTensorMemoryBarrier)
        return sizeof(newer::TensorMemoryBarrier);
    if (type == newer::kTensorDependencyInfo)
        return sizeof(newer::TensorDependencyInfo);
    if (type == newer::kPipelineOpacityMicromapFeatures)
        return sizeof(newer::PipelineOpacityMicromapFeatures);
    return 0;
}

} // namespace

const VkBaseInStructure *findInChain(const void *chain, VkStructureType type)
{
    const auto *s = static_cast<const VkBaseInStructure *>(chain);
    while (s && s->sType != type)
        s = s->pNext;
    return s;
}

// Copies all structures from the head through `last`. Returns the copy of `last`, or null if one of them has an unknown
// size.
VkBaseInStructure *Chain::ownUpTo(const VkBaseInStructure *last)
{
    VkBaseInStructure *previous = nullptr;
    for (const auto *s = static_cast<const VkBaseInStructure *>(head_); s; s = s->pNext) {
        auto *own = const_cast<VkBaseInStructure *>(s);
        if (std::find(owned_.begin(), owned_.end(), s) == owned_.end()) {
            const size_t size = structureSize(s->sType);
            if (size == 0)
                return nullptr;
            copies_.push_back(std::make_unique<Storage[]>((size + sizeof(Storage) - 1) / sizeof(Storage)));
            std::memcpy(copies_.back().get(), s, size);
            own = reinterpret_cast<VkBaseInStructure *>(copies_.back().get());
            owned_.push_back(own);
            if (previous)
                previous->pNext = own;
            else
                head_ = own;
        }
        if (s == last)
            return own;
        s = previous = own;
    }
    return nullptr;
}

VkBaseInStructure *Chain::makeOwn(VkStructureType type)
{
    const VkBaseInStructure *found = findInChain(head_, type);
    return found ? ownUpTo(found) : nullptr;
}

void Chain::remove(VkStructureType type)
{
    while (const VkBaseInStructure *found = findInChain(head_, type)) {
        if (found == head_) {
            head_ = found->pNext;
            continue;
        }
        const auto *previous = static_cast<const VkBaseInStructure *>(head_);
        while (previous->pNext != found)
            previous = previous->pNext;
        VkBaseInStructure *own = ownUpTo(previous);
        if (!own)
            return;
        own->pNext = found->pNext;
    }
}

void Chain::prepend(VkBaseInStructure *structure)
{
    structure->pNext = static_cast<const VkBaseInStructure *>(head_);
    owned_.push_back(structure);
    head_ = structure;
}

Unlinked::Unlinked(void *chain, VkStructureType type)
{
    for (auto *s = static_cast<VkBaseOutStructure *>(chain); s && s->pNext; s = s->pNext) {
        if (s->pNext->sType != type)
            continue;
        previous_ = s;
        structure_ = s->pNext;
        s->pNext = structure_->pNext;
        return;
    }
}

Unlinked::~Unlinked()
{
    if (previous_)
        previous_->pNext = structure_;
}

} // namespace vellum::layer
