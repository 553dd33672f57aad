// SPDX-License-Identifier: Apache-2.0
// A scene on a device: textures, acceleration structures, and the micromaps that they refer to.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gltf/scene.h"
#include "gpu/device.h"
#include "gpu/scene.h"
#include "gpu/timer.h"
#include "render/render_scene.h"

namespace vellum::render
{

// Textures of materials.
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

// A micromap on the device, for the geometry whose triangles its indices are for.
class DeviceMicromap
{
public:
    // Uploads it. `micromap` must be valid; if it has only special indices there is no micromap object.
    DeviceMicromap(gpu::Device &device, const Micromap &micromap);

    // Builds it. Returns how long that took, by the clock from its recording to its end.
    gpu::Milliseconds build();
    // Valid as long as this lives.
    [[nodiscard]] gpu::Attachment attachment() const;
    // Bytes of the micromap and of its indices.
    [[nodiscard]] VkDeviceSize bytes() const;
    // Frees what the build read.
    void forgetInput();

private:
    gpu::Device &device_;
    std::unique_ptr<gpu::Micromap> micromap_;
    std::vector<int32_t> indices_;
    uint32_t base_;
};

// The scene to trace: a bottom level for each mesh, one for the ground, and a top level with the instances of all
// copies.
class World
{
public:
    // `micromaps`: none, or one for each geometry of the scene (null for geometries without).
    World(gpu::Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps);

    [[nodiscard]] VkAccelerationStructureKHR top() const { return top_->handle(); }
    [[nodiscard]] VkDeviceSize micromapBytes() const;
    // Bytes of the acceleration structures.
    [[nodiscard]] VkDeviceSize structureBytes() const;

private:
    std::unique_ptr<gpu::Blas> buildBottom(gpu::Device &device, std::span<const Geometry> geometries,
                                           const Scene *materials, std::span<const Micromap *const> micromaps);
    void buildTop(const RenderScene &scene);

    std::vector<std::unique_ptr<DeviceMicromap>> micromaps_;
    std::vector<std::unique_ptr<gpu::Blas>> meshes_;
    std::unique_ptr<gpu::Blas> ground_;
    std::unique_ptr<gpu::Tlas> top_;
};

} // namespace vellum::render
