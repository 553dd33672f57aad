// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/scratch_memory.h"

#include <algorithm>

#include "core/align.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kLeast = 1024;
constexpr VkDeviceSize kKept = 1024 * 1024; // between recordings

} // namespace

VkBufferUsageFlags scratchUsage(const GpuContext &context)
{
    VkBufferUsageFlags usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    // These flags belong to an extension that has to be enabled.
    if (context.next->CreateRayTracingPipelinesKHR)
        usage |= VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT |
                 VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    // For changed inputs of builds.
    if (context.driversMicromaps)
        usage |= VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    return usage;
}

VkDeviceAddress ScratchMemory::allocate(VkDeviceSize bytes)
{
    const VkDeviceSize needed = alignUp(std::max<VkDeviceSize>(bytes, 1), kScratchAlignment);
    const VkDeviceSize had = pieces_.empty() ? 0 : pieces_.back().bytes();
    if (had - next_ < needed) {
        // Half as large again as the last one, so that copies of growing structures need few pieces.
        PooledMemory piece(pool_, std::max(needed + had + had / 2, kLeast));
        if (!piece.address())
            return 0;
        pieces_.push_back(std::move(piece));
        next_ = 0;
    }
    const VkDeviceAddress address = pieces_.back().address() + next_;
    next_ += needed;
    return address;
}

void ScratchMemory::reset()
{
    next_ = 0;
    if (pieces_.empty())
        return;
    if (pieces_.back().bytes() > kKept)
        pieces_.clear();
    else
        pieces_.erase(pieces_.begin(), pieces_.end() - 1);
}

void ScratchMemory::release()
{
    next_ = 0;
    pieces_.clear();
}

} // namespace vellum::layer
