#include "layer/transient_memory.h"

#include <algorithm>

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kAlignment = 256; // shaderGroupBaseAlignment is at most 64
constexpr VkDeviceSize kLeast = 16 * 1024;
constexpr VkBufferUsageFlags kUsage =
    VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;

} // namespace

VkDeviceAddress TransientMemory::get(const GpuContext &context, VkDeviceSize bytes)
{
    if (blocks_.empty() || blocks_.back().size < bytes) {
        Block block;
        // Doubling keeps them few.
        block.size = std::max({kLeast, bytes, blocks_.empty() ? 0 : 2 * blocks_.back().size});
        // Where a buffer begins is the driver's choice.
        if (block.buffer.create(context, block.size + kAlignment, kUsage) != VK_SUCCESS)
            return 0;
        blocks_.push_back(std::move(block));
    }
    return (blocks_.back().buffer.address() + kAlignment - 1) & ~(kAlignment - 1);
}

void TransientMemory::reset()
{
    if (blocks_.size() > 1)
        blocks_.erase(blocks_.begin(), blocks_.end() - 1);
}

} // namespace vellum::layer
