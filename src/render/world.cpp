// SPDX-License-Identifier: Apache-2.0
#include "render/world.h"

#include <cstring>
#include <utility>

namespace vellum::render
{
namespace
{

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

// Delegates, so that the destructor also runs where this throws.
Texture::Texture(gpu::Device &device, const Image &image, const Material &material) : Texture()
{
    device_ = device.device();
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
        throw std::runtime_error("a texture is larger than the device's limit of " + std::to_string(largest) +
                                 " texels");
    CHECK_VK(vkCreateImage(device_, &info, nullptr, &image_));
    VkMemoryRequirements requirements;
    vkGetImageMemoryRequirements(device_, image_, &requirements);
    const VkMemoryAllocateInfo memory{
        VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, requirements.size,
        device.memoryType(requirements.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT)};
    CHECK_VK(vkAllocateMemory(device_, &memory, nullptr, &memory_));
    CHECK_VK(vkBindImageMemory(device_, image_, memory_, 0));
    upload(device, image);

    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = image_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = kFormat;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    CHECK_VK(vkCreateImageView(device_, &view, nullptr, &view_));
    VkSamplerCreateInfo sampler{};
    sampler.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
    sampler.magFilter = material.filter == Filter::Nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    sampler.minFilter = sampler.magFilter;
    sampler.addressModeU = addressMode(material.wrapU);
    sampler.addressModeV = addressMode(material.wrapV);
    CHECK_VK(vkCreateSampler(device_, &sampler, nullptr, &sampler_));
}

void Texture::upload(gpu::Device &device, const Image &image)
{
    const gpu::Buffer staging(device, image.rgba.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    std::memcpy(staging.bytes(), image.rgba.data(), image.rgba.size());
    device.submit([&](VkCommandBuffer commands) {
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

namespace
{

constexpr VkBuildAccelerationStructureFlagsKHR kFastTrace = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;

// The matrix of an object at `place` in a copy with that placement.
VkTransformMatrixKHR matrixOf(const Placement &placement, const Transform &place)
{
    VkTransformMatrixKHR matrix{};
    for (size_t column = 0; column < 4; ++column) {
        const Vec3 axis = {place[0][column], place[1][column], place[2][column]};
        const Vec3 image =
            Placement{placement.angle, placement.scale, column < 3 ? Vec3{} : placement.offset}.apply(axis);
        for (size_t row = 0; row < 3; ++row)
            matrix.matrix[row][column] = image[row];
    }
    return matrix;
}

gpu::MicromapInput inputOf(const Micromap &micromap)
{
    static_assert(sizeof(MicromapTriangle) == sizeof(VkMicromapTriangleEXT));
    gpu::MicromapInput input;
    input.data = micromap.data;
    input.triangles.resize(micromap.triangles.size());
    std::memcpy(input.triangles.data(), micromap.triangles.data(),
                input.triangles.size() * sizeof(VkMicromapTriangleEXT));
    return input;
}

gpu::Geometry geometryOf(const Geometry &from, bool masked)
{
    gpu::Geometry geometry;
    geometry.vertices = from.positions;
    geometry.indices = from.indices;
    geometry.indexType = VK_INDEX_TYPE_UINT32;
    geometry.flags = masked ? VkGeometryFlagsKHR{0} : VkGeometryFlagsKHR{VK_GEOMETRY_OPAQUE_BIT_KHR};
    return geometry;
}

} // namespace

DeviceMicromap::DeviceMicromap(gpu::Device &device, const Micromap &micromap)
    : device_(device), indices_(micromap.indices), base_(micromap.baseTriangle)
{
    if (!micromap.triangles.empty())
        micromap_ =
            std::make_unique<gpu::Micromap>(device, inputOf(micromap), VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT);
}

gpu::Milliseconds DeviceMicromap::build()
{
    if (!micromap_)
        return {};
    const gpu::GpuTimer timer(device_);
    return timer.time([&] {
        device_.submit([&](VkCommandBuffer commands) {
            timer.begin(commands);
            micromap_->record(commands);
            timer.end(commands);
        });
    });
}

gpu::Attachment DeviceMicromap::attachment() const
{
    return {.micromap = micromap_.get(), .indexType = VK_INDEX_TYPE_UINT32, .indices = indices_, .base = base_};
}

VkDeviceSize DeviceMicromap::bytes() const
{
    return (micromap_ ? micromap_->size() : 0) + indices_.size() * sizeof(int32_t);
}

void DeviceMicromap::forgetInput()
{
    if (micromap_)
        micromap_->forgetInput();
}

World::World(gpu::Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps)
    : top_(std::make_unique<gpu::Tlas>(device))
{
    for (const Mesh &mesh : scene.scene.meshes) {
        const auto part = [&](auto all) { return all.subspan(mesh.firstGeometry, mesh.geometryCount); };
        meshes_.push_back(buildBottom(device, part(std::span(scene.scene.geometries)), &scene.scene,
                                      micromaps.empty() ? micromaps : part(micromaps)));
    }
    ground_ = buildBottom(device, std::span(&scene.ground, 1), nullptr, {});
    buildTop(scene);
}

std::unique_ptr<gpu::Blas> World::buildBottom(gpu::Device &device, std::span<const Geometry> geometries,
                                              const Scene *materials, std::span<const Micromap *const> micromaps)
{
    std::vector<gpu::Geometry> inputs;
    for (size_t i = 0; i < geometries.size(); ++i) {
        const bool masked = materials != nullptr && materials->materials[geometries[i].material].masked();
        inputs.push_back(geometryOf(geometries[i], masked));
        if (i >= micromaps.size() || micromaps[i] == nullptr)
            continue;
        DeviceMicromap &micromap = *micromaps_.emplace_back(std::make_unique<DeviceMicromap>(device, *micromaps[i]));
        micromap.build();
        inputs.back().micromap = micromap.attachment();
        micromap.forgetInput();
    }
    auto bottom = std::make_unique<gpu::Blas>(device, std::move(inputs), kFastTrace);
    bottom->forgetInput();
    return bottom;
}

void World::buildTop(const RenderScene &scene)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    const auto add = [&](const VkTransformMatrixKHR &transform, size_t firstRecord, const gpu::Blas &bottom) {
        VkAccelerationStructureInstanceKHR &instance = instances.emplace_back();
        instance.transform = transform;
        instance.instanceCustomIndex = static_cast<uint32_t>(firstRecord) & 0xffffffu;
        instance.mask = 0xff;
        instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
        instance.accelerationStructureReference = bottom.address();
    };
    for (const Placement &copy : scene.copies)
        for (const MeshInstance &i : scene.scene.instances)
            add(matrixOf(copy, i.transform), scene.scene.meshes[i.mesh].firstGeometry, *meshes_[i.mesh]);
    add(matrixOf({}, kInPlace), scene.records.size() - 1, *ground_);
    top_->build(instances, kFastTrace);
    top_->forgetInput();
}

VkDeviceSize World::structureBytes() const
{
    VkDeviceSize bytes = top_->size() + ground_->size();
    for (const auto &mesh : meshes_)
        bytes += mesh->size();
    return bytes;
}

VkDeviceSize World::micromapBytes() const
{
    VkDeviceSize bytes = 0;
    for (const auto &micromap : micromaps_)
        bytes += micromap->bytes();
    return bytes;
}

} // namespace vellum::render
