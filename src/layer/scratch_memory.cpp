#include "layer/scratch_memory.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kAlignment = 256;

} // namespace

VkDeviceAddress ScratchMemory::allocate(const GpuContext &context, VkDeviceSize bytes)
{
    const VkDeviceSize needed = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    if (end_ - next_ < needed) {
        // Larger by half than the last one, so that copies of growing structures make few.
        const VkDeviceSize chunk = needed + (end_ - begin_) + (end_ - begin_) / 2;
        GpuBuffer buffer;
        if (buffer.create(context, chunk + kAlignment,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR,
                          GpuBuffer::Content::Undefined) != VK_SUCCESS)
            return 0;
        begin_ = next_ = (buffer.address() + kAlignment - 1) / kAlignment * kAlignment;
        end_ = begin_ + chunk;
        chunks_.push_back(std::move(buffer));
    }
    const VkDeviceAddress address = next_;
    next_ += needed;
    return address;
}

void ScratchMemory::reset()
{
    chunks_.clear();
    begin_ = next_ = end_ = 0;
}

} // namespace vellum::layer
