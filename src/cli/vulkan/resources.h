// SPDX-License-Identifier: Apache-2.0
// Buffers and textures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "cli/vulkan/context.h"
#include "gltf/scene.h"

namespace vellum::cli
{

class Buffer
{
public:
    enum class Place { Device, Host };

    Buffer() = default;
    // A buffer of at least one byte. On the host it is mapped and coherent. Throws Error.
    Buffer(Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place);
    ~Buffer();
    Buffer(Buffer &&other) noexcept { *this = std::move(other); }
    Buffer &operator=(Buffer &&other) noexcept;

    [[nodiscard]] VkBuffer handle() const { return buffer_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    [[nodiscard]] void *mapped() const { return memory_.mapped; }
    // The first address that is a multiple of `alignment`. Needs VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    [[nodiscard]] VkDeviceAddress address(VkDeviceSize alignment = 1) const;

private:
    VkDevice device_ = VK_NULL_HANDLE;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    MemoryPool *pool_ = nullptr;
    MemoryPool::Piece memory_;
    VkDeviceSize size_ = 0;
};

// A buffer in the device's memory with these bytes at its first address that is a multiple of `alignment`, and zeros
// around them.
Buffer uploadBuffer(Device &device, std::span<const std::byte> bytes, VkBufferUsageFlags usage,
                    VkDeviceSize alignment = 1);

// The first bytes of a device buffer that can be copied from.
std::vector<uint32_t> downloadWords(Device &device, const Buffer &buffer, size_t words);

class Texture
{
public:
    // The material tells how it is sampled. Throws Error.
    Texture(Device &device, const Image &image, const Material &material);
    ~Texture();
    Texture(Texture &&other) noexcept { *this = std::move(other); }
    Texture &operator=(Texture &&other) noexcept;

    [[nodiscard]] VkImageView view() const { return view_; }
    [[nodiscard]] VkSampler sampler() const { return sampler_; }

private:
    Texture() = default;
    void upload(Device &device, const Image &image);

    VkDevice device_ = VK_NULL_HANDLE;
    VkImage image_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkImageView view_ = VK_NULL_HANDLE;
    VkSampler sampler_ = VK_NULL_HANDLE;
};

} // namespace vellum::cli
