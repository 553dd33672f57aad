// SPDX-License-Identifier: Apache-2.0
#include "gpu/memory_pool.h"

#include <algorithm>

#include "gpu/device.h"

namespace vellum::gpu
{
namespace
{

constexpr VkDeviceSize kBlock = VkDeviceSize{8} << 20;
constexpr VkDeviceSize kSmall = kBlock / 8; // sizes up to this share a block

} // namespace

// Pieces are taken one behind the other; their memory is used anew when all are freed.
class MemoryPool::Block
{
public:
    uint32_t type = 0;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceSize size = 0;
    VkDeviceSize used = 0;
    size_t pieces = 0;
};

MemoryPool::MemoryPool(VkDevice device) : device_(device) {}

MemoryPool::~MemoryPool()
{
    for (const auto &block : blocks_)
        vkFreeMemory(device_, block->memory, nullptr);
}

MemoryPool::Piece MemoryPool::allocate(const VkMemoryRequirements &requirements, uint32_t type)
{
    const auto offsetIn = [&](const Block &block) {
        return (block.used + requirements.alignment - 1) / requirements.alignment * requirements.alignment;
    };
    const auto fits = [&](const std::unique_ptr<Block> &block) {
        return block->type == type && offsetIn(*block) <= block->size &&
               requirements.size <= block->size - offsetIn(*block);
    };
    auto found = std::find_if(blocks_.begin(), blocks_.end(), fits);
    if (found == blocks_.end()) {
        auto block = std::make_unique<Block>();
        block->type = type;
        block->size = requirements.size <= kSmall ? kBlock : requirements.size;
        const VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, nullptr,
                                              VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT, 0};
        const VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, block->size, type};
        CHECK_VK(vkAllocateMemory(device_, &info, nullptr, &block->memory));
        blocks_.push_back(std::move(block));
        found = blocks_.end() - 1;
    }
    Block &block = **found;
    const VkDeviceSize offset = offsetIn(block);
    block.used = offset + requirements.size;
    ++block.pieces;
    return {block.memory, offset, &block};
}

void MemoryPool::free(const Piece &piece)
{
    if (piece.block == nullptr || --piece.block->pieces != 0)
        return;
    piece.block->used = 0;
    if (piece.block->size == kBlock)
        return;
    vkFreeMemory(device_, piece.memory, nullptr);
    std::erase_if(blocks_, [&](const auto &block) { return block.get() == piece.block; });
}

} // namespace vellum::gpu
