// SPDX-License-Identifier: Apache-2.0
#include "layer/state/structure_descriptor_pool.h"

#include <algorithm>
#include <utility>

#include "core/records.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr VkDeviceSize kDescriptorBytes = kDescriptorWords * 4;
// Whole pages of every processor: the pages of a pool are not those of other memory.
constexpr VkDeviceSize kBufferBytes = 131072;
constexpr uint32_t kDescriptorsPerBuffer = kBufferBytes / kDescriptorBytes;
static_assert(kDescriptorBytes % kDescriptorGenerations == 0);

} // namespace

uint32_t *StructureDescriptorPool::words(uint32_t descriptor) const
{
    return buffers_[descriptor / kDescriptorsPerBuffer].words() +
           size_t{descriptor % kDescriptorsPerBuffer} * kDescriptorWords;
}

StructureDescriptor StructureDescriptorPool::location(uint32_t descriptor) const
{
    const GpuBuffer &buffer = buffers_[descriptor / kDescriptorsPerBuffer];
    const VkDeviceSize offset = descriptor % kDescriptorsPerBuffer * kDescriptorBytes;
    return {buffer.address() + offset + generations_[descriptor], buffer.buffer(), offset, words(descriptor)};
}

bool StructureDescriptorPool::grow(const GpuContext &context)
{
    GpuBuffer buffer;
    if (buffer.create(context, kBufferBytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT) != VK_SUCCESS ||
        buffer.address() % kDescriptorGenerations != 0)
        return false;
    const auto first = static_cast<uint32_t>(generations_.size());
    const uint32_t end = first + kDescriptorsPerBuffer;
    buffers_.reserve(buffers_.size() + 1);
    generations_.reserve(end);
    free_.reserve(end); // enough for all, so that release() does not allocate
    buffers_.push_back(std::move(buffer));
    generations_.resize(end);
    for (uint32_t i = end; i-- > first;)
        free_.push_back(i);
    return true;
}

uint32_t StructureDescriptorPool::acquire(const GpuContext &context)
{
    if (free_.empty() && !grow(context))
        return kNone;
    const uint32_t descriptor = free_.back();
    free_.pop_back();
    if (writer_ == Writer::Host)
        std::fill_n(words(descriptor), kDescriptorWords, 0u);
    return descriptor;
}

void StructureDescriptorPool::release(uint32_t descriptor)
{
    if (writer_ == Writer::Device)
        generations_[descriptor] = static_cast<uint8_t>((generations_[descriptor] + 1u) % kDescriptorGenerations);
    free_.push_back(descriptor);
}

} // namespace vellum::layer
