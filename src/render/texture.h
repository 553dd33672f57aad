// SPDX-License-Identifier: Apache-2.0
// Textures of materials.
#pragma once

#include "gltf/scene.h"
#include "gpu/device.h"

namespace vellum::render
{

class Texture
{
public:
    // The material states how it is sampled. Throws gpu::VulkanError or std::runtime_error.
    Texture(gpu::Device &device, const Image &image, const Material &material);
    ~Texture();
    Texture(Texture &&other) noexcept { *this = std::move(other); }
    Texture &operator=(Texture &&other) noexcept;

    [[nodiscard]] VkImageView view() const { return view_; }
    [[nodiscard]] VkSampler sampler() const { return sampler_; }

private:
    Texture() = default;
    void upload(gpu::Device &device, const Image &image);

    VkDevice device_ = VK_NULL_HANDLE;
    VkImage image_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkImageView view_ = VK_NULL_HANDLE;
    VkSampler sampler_ = VK_NULL_HANDLE;
};

} // namespace vellum::render
