// SPDX-License-Identifier: Apache-2.0
#include "layer/base/pnext.h"

#include <algorithm>
#include <cstring>

#include "vk/structure_sizes.h"

namespace vellum::layer
{
namespace
{

static_assert(sizeof(void *) == 8, "vk/structure_sizes.h has the sizes of 64-bit systems");

// Null if it is unknown.
const StructureSize *findSize(VkStructureType type)
{
    const auto *found = std::ranges::lower_bound(kStructureSizes, int32_t{type}, {}, &StructureSize::type);
    return found != std::end(kStructureSizes) && found->type == type ? found : nullptr;
}

// 0 if it is unknown.
size_t structureSize(VkStructureType type)
{
    // Structures of the loader are not in the registry; one is at the head of every VkDeviceCreateInfo chain.
    if (type == VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO || type == VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO)
        return 4 * sizeof(void *);
    const auto *found = findSize(type);
    return found ? found->bytes : 0;
}

} // namespace

const char *structureName(VkStructureType type)
{
    const auto *found = findSize(type);
    return found ? found->name : nullptr;
}

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
