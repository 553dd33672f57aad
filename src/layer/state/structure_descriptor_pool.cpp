// SPDX-License-Identifier: Apache-2.0
#include "layer/state/structure_descriptor_pool.h"

#include <algorithm>

#include "core/records.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kPageBytes = StructureDescriptorPool::kPageBytes;
constexpr uint32_t kDescriptorsPerPage = kPageBytes / (kDescriptorWords * 4);
constexpr uint32_t kPagesPerBuffer = 131072 / kPageBytes;

} // namespace

uint32_t *StructureDescriptorPool::words(uint32_t descriptor) const
{
    constexpr uint32_t kDescriptorsPerBuffer = kPagesPerBuffer * kDescriptorsPerPage;
    return buffers_[descriptor / kDescriptorsPerBuffer].words() +
           size_t{descriptor % kDescriptorsPerBuffer} * kDescriptorWords;
}

StructureDescriptor StructureDescriptorPool::location(uint32_t descriptor) const
{
    constexpr uint32_t kDescriptorsPerBuffer = kPagesPerBuffer * kDescriptorsPerPage;
    const GpuBuffer &buffer = buffers_[descriptor / kDescriptorsPerBuffer];
    const VkDeviceSize offset = VkDeviceSize{descriptor % kDescriptorsPerBuffer} * kDescriptorWords * 4;
    return {buffer.address() + offset, buffer.buffer(), offset, words(descriptor)};
}

bool StructureDescriptorPool::grow(const GpuContext &context)
{
    GpuBuffer buffer;
    if (buffer.create(context, VkDeviceSize{kPagesPerBuffer} * kPageBytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT) !=
        VK_SUCCESS)
        return false;
    const auto first = static_cast<uint32_t>(pages_.size());
    pages_.reserve(first + kPagesPerBuffer);
    emptyPages_.reserve(first + kPagesPerBuffer); // enough for all pages, so that release() does not allocate
    buffers_.push_back(std::move(buffer));
    pages_.resize(first + kPagesPerBuffer);
    for (uint32_t i = kPagesPerBuffer; i-- > 0;)
        emptyPages_.push_back(first + i);
    return true;
}

uint32_t StructureDescriptorPool::acquire(const GpuContext &context)
{
    if (open_ == kNone || pages_[open_].taken == kDescriptorsPerPage) {
        if (emptyPages_.empty() && !grow(context))
            return kNone;
        open_ = emptyPages_.back();
        emptyPages_.pop_back();
        Page &page = pages_[open_];
        if (page.taken > 0)
            std::fill_n(words(open_ * kDescriptorsPerPage), kPageBytes / 4, 0u);
        page.taken = 0;
    }
    Page &page = pages_[open_];
    ++page.inUse;
    return open_ * kDescriptorsPerPage + page.taken++;
}

void StructureDescriptorPool::release(uint32_t descriptor)
{
    const uint32_t number = descriptor / kDescriptorsPerPage;
    if (--pages_[number].inUse > 0)
        return;
    emptyPages_.push_back(number);
    if (open_ == number)
        open_ = kNone;
}

} // namespace vellum::layer
