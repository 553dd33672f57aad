// SPDX-License-Identifier: Apache-2.0
#include "cli/vulkan/resources.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/align.h"

namespace vellum::cli
{
namespace
{

uint32_t memoryTypeFor(Device &device, const VkMemoryRequirements &requirements, Buffer::Place place)
{
    const bool host = place == Buffer::Place::Host;
    const auto type = device.memoryType(
        requirements.memoryTypeBits,
        host ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT : VkMemoryPropertyFlags{0},
        host ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    if (!type)
        throw Error("the device has no memory of the needed kind");
    return *type;
}

VkSamplerAddressMode addressMode(Wrap wrap)
{
    switch (wrap) {
    case Wrap::Repeat: return VK_SAMPLER_ADDRESS_MODE_REPEAT;
    case Wrap::Mirror: return VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT;
    case Wrap::Border: return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
    case Wrap::MirrorOnce: return VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE;
    case Wrap::Clamp: break;
    }
    return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
}

} // namespace

// Constructors delegate to the empty one, so that the destructor also runs where they throw.
Buffer::Buffer(Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place) : Buffer()
{
    device_ = device.handle();
    size_ = std::max<VkDeviceSize>(size, 16);
    VkBufferCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.size = size_;
    info.usage = usage;
    check(vkCreateBuffer(device_, &info, nullptr, &buffer_), "creating a buffer");
    VkMemoryRequirements requirements;
    vkGetBufferMemoryRequirements(device_, buffer_, &requirements);
    pool_ = &device.bufferMemory();
    memory_ = pool_->allocate(requirements, memoryTypeFor(device, requirements, place), place == Place::Host);
    check(vkBindBufferMemory(device_, buffer_, memory_.memory, memory_.offset), "binding memory");
}

Buffer::~Buffer()
{
    if (device_ == VK_NULL_HANDLE)
        return;
    vkDestroyBuffer(device_, buffer_, nullptr);
    if (pool_ != nullptr)
        pool_->free(memory_);
}

Buffer &Buffer::operator=(Buffer &&other) noexcept
{
    std::swap(device_, other.device_);
    std::swap(buffer_, other.buffer_);
    std::swap(memory_, other.memory_);
    std::swap(pool_, other.pool_);
    std::swap(size_, other.size_);
    return *this;
}

VkDeviceAddress Buffer::address(VkDeviceSize alignment) const
{
    const VkBufferDeviceAddressInfo info{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer_};
    return alignUp(vkGetBufferDeviceAddress(device_, &info), alignment);
}

Buffer uploadBuffer(Device &device, std::span<const std::byte> bytes, VkBufferUsageFlags usage, VkDeviceSize alignment)
{
    const VkDeviceSize size = alignUp(bytes.size(), 16) + (alignment - 1) / 16 * 16 + 16;
    Buffer buffer(device, size, usage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::Device);
    const VkDeviceSize offset = alignment > 1 ? buffer.address(alignment) - buffer.address() : 0;
    const Buffer staging(device, size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::Host);
    std::memset(staging.mapped(), 0, size);
    if (!bytes.empty())
        std::memcpy(static_cast<std::byte *>(staging.mapped()) + offset, bytes.data(), bytes.size());
    device.run([&](VkCommandBuffer commands) {
        const VkBufferCopy region{0, 0, size};
        vkCmdCopyBuffer(commands, staging.handle(), buffer.handle(), 1, &region);
        const VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_TRANSFER_WRITE_BIT,
                                      VK_ACCESS_MEMORY_READ_BIT};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1,
                             &barrier, 0, nullptr, 0, nullptr);
    });
    return buffer;
}

std::vector<uint32_t> downloadWords(Device &device, const Buffer &buffer, size_t words)
{
    const VkDeviceSize size = words * sizeof(uint32_t);
    const Buffer staging(device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::Host);
    device.run([&](VkCommandBuffer commands) {
        const VkBufferCopy region{0, 0, size};
        vkCmdCopyBuffer(commands, buffer.handle(), staging.handle(), 1, &region);
        const VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_TRANSFER_WRITE_BIT,
                                      VK_ACCESS_HOST_READ_BIT};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0,
                             nullptr, 0, nullptr);
    });
    std::vector<uint32_t> result(words);
    std::memcpy(result.data(), staging.mapped(), size);
    return result;
}

Texture::Texture(Device &device, const Image &image, const Material &material) : Texture()
{
    device_ = device.handle();
    // UNORM, not SRGB: alpha is the same, and the conversion is done once per hit instead of once per texel.
    constexpr VkFormat kFormat = VK_FORMAT_R8G8B8A8_UNORM;
    VkImageCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = kFormat;
    info.extent = {image.width, image.height, 1};
    info.mipLevels = 1;
    info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.tiling = VK_IMAGE_TILING_OPTIMAL;
    info.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    const uint32_t largest = device.limits().maxImageDimension2D;
    if (image.width > largest || image.height > largest)
        throw Error("a texture is larger than the device's limit of " + std::to_string(largest) + " texels");
    check(vkCreateImage(device_, &info, nullptr, &image_), "creating an image");
    VkMemoryRequirements requirements;
    vkGetImageMemoryRequirements(device_, image_, &requirements);
    const VkMemoryAllocateInfo memory{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, requirements.size,
                                      memoryTypeFor(device, requirements, Buffer::Place::Device)};
    check(vkAllocateMemory(device_, &memory, nullptr, &memory_), "allocating device memory");
    check(vkBindImageMemory(device_, image_, memory_, 0), "binding memory");
    upload(device, image);

    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = image_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = kFormat;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    check(vkCreateImageView(device_, &view, nullptr, &view_), "creating an image view");
    VkSamplerCreateInfo sampler{};
    sampler.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
    sampler.magFilter = material.filter == Filter::Nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    sampler.minFilter = sampler.magFilter;
    sampler.addressModeU = addressMode(material.wrapU);
    sampler.addressModeV = addressMode(material.wrapV);
    check(vkCreateSampler(device_, &sampler, nullptr, &sampler_), "creating a sampler");
}

void Texture::upload(Device &device, const Image &image)
{
    const Buffer staging(device, image.rgba.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::Host);
    std::memcpy(staging.mapped(), image.rgba.data(), image.rgba.size());
    device.run([&](VkCommandBuffer commands) {
        VkImageMemoryBarrier barrier{};
        barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
        barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.oldLayout = VK_IMAGE_LAYOUT_UNDEFINED;
        barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        barrier.image = image_;
        barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr,
                             0, nullptr, 1, &barrier);
        VkBufferImageCopy region{};
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
        region.imageExtent = {image.width, image.height, 1};
        vkCmdCopyBufferToImage(commands, staging.handle(), image_, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
        barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
        barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        barrier.newLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                             nullptr, 0, nullptr, 1, &barrier);
    });
}

Texture::~Texture()
{
    if (device_ == VK_NULL_HANDLE)
        return;
    vkDestroySampler(device_, sampler_, nullptr);
    vkDestroyImageView(device_, view_, nullptr);
    vkDestroyImage(device_, image_, nullptr);
    vkFreeMemory(device_, memory_, nullptr);
}

Texture &Texture::operator=(Texture &&other) noexcept
{
    std::swap(device_, other.device_);
    std::swap(image_, other.image_);
    std::swap(memory_, other.memory_);
    std::swap(view_, other.view_);
    std::swap(sampler_, other.sampler_);
    return *this;
}

} // namespace vellum::cli
