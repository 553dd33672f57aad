#include "layer/memory/scratch_memory.h"

#include <algorithm>

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kAlignment = 256; // shaderGroupBaseAlignment is at most 64
constexpr VkDeviceSize kLeast = 16 * 1024;
constexpr VkDeviceSize kKept = 32 * 1024 * 1024; // between recordings

VkBufferUsageFlags usageOn(const GpuContext &context)
{
    VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    // A flag of the extension, that has to be enabled for it.
    if (context.next->CreateRayTracingPipelinesKHR)
        usage |= VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
    return usage;
}

} // namespace

ScratchMemory::Place ScratchMemory::place(const GpuContext &context, VkDeviceSize bytes)
{
    const VkDeviceSize needed = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    if (end_ - next_ < needed) {
        // Larger by half than the last one, so that copies of growing structures make few.
        const VkDeviceSize chunk = std::max(needed + (end_ - begin_) + (end_ - begin_) / 2, kLeast);
        GpuBuffer buffer;
        if (buffer.create(context, chunk + kAlignment, usageOn(context), GpuBuffer::Content::Undefined) != VK_SUCCESS)
            return {};
        begin_ = next_ = (buffer.address() + kAlignment - 1) / kAlignment * kAlignment;
        end_ = begin_ + chunk;
        chunks_.push_back(std::move(buffer));
    }
    const Place place{next_, chunks_.back().buffer(), next_ - chunks_.back().address()};
    next_ += needed;
    return place;
}

void ScratchMemory::reset()
{
    if (end_ - begin_ > kKept) {
        chunks_.clear();
        begin_ = end_ = 0;
    } else if (chunks_.size() > 1) {
        chunks_.erase(chunks_.begin(), chunks_.end() - 1);
    }
    next_ = begin_;
}

} // namespace vellum::layer
