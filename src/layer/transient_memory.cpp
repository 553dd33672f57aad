#include "layer/transient_memory.h"

#include <algorithm>

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kAlignment = 256; // shaderGroupBaseAlignment is at most 64
constexpr VkDeviceSize kBlockBytes = 64 * 1024;
constexpr VkBufferUsageFlags kUsage =
    VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;

} // namespace

VkDeviceAddress TransientMemory::allocate(const GpuContext &context, VkDeviceSize bytes)
{
    const VkDeviceSize aligned = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    for (; current_ < blocks_.size(); ++current_, used_ = 0) {
        const Block &block = blocks_[current_];
        // Where a buffer begins is the driver's choice.
        const VkDeviceAddress begin = (block.buffer.address() + kAlignment - 1) & ~(kAlignment - 1);
        if (begin + used_ + aligned <= block.buffer.address() + block.size) {
            const VkDeviceAddress address = begin + used_;
            used_ += aligned;
            return address;
        }
    }
    Block block;
    block.size = std::max(kBlockBytes, aligned + kAlignment);
    if (block.buffer.create(context, block.size, kUsage) != VK_SUCCESS)
        return 0;
    blocks_.push_back(std::move(block));
    used_ = aligned;
    return (blocks_.back().buffer.address() + kAlignment - 1) & ~(kAlignment - 1);
}

void TransientMemory::reset()
{
    current_ = 0;
    used_ = 0;
}

} // namespace vellum::layer
