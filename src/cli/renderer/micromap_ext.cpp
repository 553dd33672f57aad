// SPDX-License-Identifier: Apache-2.0
// Micromaps as objects of their own: VK_EXT_opacity_micromap.
#include "cli/renderer/acceleration.h"

namespace vellum::cli
{
namespace
{

// VkMicromapBuildInfoEXT: scratch, data and triangle addresses are multiples of 256
// (VUID-vkCmdBuildMicromapsEXT-pInfos-07514 and -07515, and the storage offset by
// VUID-VkMicromapCreateInfoEXT-offset-07437).
constexpr VkDeviceSize kAlignment = 256;

constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

std::vector<VkMicromapUsageEXT> toVulkan(const std::vector<MicromapUsage> &usages)
{
    std::vector<VkMicromapUsageEXT> result;
    for (const MicromapUsage &u : usages)
        result.push_back({u.count, u.subdivisionLevel, static_cast<uint32_t>(u.format)});
    return result;
}

// Between the micromap's build and the acceleration structure build that reads it.
void micromapBarrier(VkCommandBuffer commands)
{
    const VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                   nullptr,
                                   VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT,
                                   VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT,
                                   VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                   VK_ACCESS_2_MICROMAP_READ_BIT_EXT};
    VkDependencyInfo dependency{};
    dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &barrier;
    vkCmdPipelineBarrier2(commands, &dependency);
}

class ExtMicromap final : public GpuMicromap
{
public:
    ExtMicromap(Device &device, const Micromap &micromap);
    ~ExtMicromap() override;
    ExtMicromap(const ExtMicromap &) = delete;
    ExtMicromap &operator=(const ExtMicromap &) = delete;

    [[nodiscard]] const void *attachment() const override { return &attachment_; }

private:
    void build(const Micromap &micromap);

    Buffer storage_;
    VkMicromapEXT micromap_ = VK_NULL_HANDLE;
    std::vector<VkMicromapUsageEXT> usage_;
    VkAccelerationStructureTrianglesOpacityMicromapEXT attachment_{};
};

ExtMicromap::ExtMicromap(Device &device, const Micromap &micromap) : GpuMicromap(device, micromap)
{
    if (!micromap.triangles.empty())
        build(micromap);
    usage_ = toVulkan(micromap.geometryUsage());
    attachment_.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT;
    attachment_.indexType = VK_INDEX_TYPE_UINT32;
    attachment_.indexBuffer.deviceAddress = indices_.address();
    attachment_.indexStride = sizeof(int32_t);
    attachment_.baseTriangle = micromap.baseTriangle;
    attachment_.usageCountsCount = static_cast<uint32_t>(usage_.size());
    attachment_.pUsageCounts = usage_.data();
    attachment_.micromap = micromap_;
}

ExtMicromap::~ExtMicromap()
{
    if (micromap_ != VK_NULL_HANDLE)
        device_.functions().destroyMicromap(device_.handle(), micromap_, nullptr);
}

void ExtMicromap::build(const Micromap &micromap)
{
    static_assert(sizeof(MicromapTriangle) == sizeof(VkMicromapTriangleEXT));
    const VkBufferUsageFlags input = kAddress | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    const Buffer data = uploadBuffer(device_, std::as_bytes(std::span(micromap.data)), input, kAlignment);
    const Buffer triangles = uploadBuffer(device_, std::as_bytes(std::span(micromap.triangles)), input, kAlignment);
    const std::vector<VkMicromapUsageEXT> usage = toVulkan(micromap.buildUsage());

    VkMicromapBuildInfoEXT info{};
    info.sType = VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT;
    info.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    info.flags = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
    info.mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT;
    info.usageCountsCount = static_cast<uint32_t>(usage.size());
    info.pUsageCounts = usage.data();
    info.data.deviceAddress = data.address(kAlignment);
    info.triangleArray.deviceAddress = triangles.address(kAlignment);
    info.triangleArrayStride = sizeof(VkMicromapTriangleEXT);
    VkMicromapBuildSizesInfoEXT sizes{};
    sizes.sType = VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT;
    const DeviceFunctions &vk = device_.functions();
    vk.getMicromapBuildSizes(device_.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &sizes);

    micromapBytes_ = sizes.micromapSize;
    storage_ =
        Buffer(device_, sizes.micromapSize, kAddress | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT, Buffer::Place::Device);
    VkMicromapCreateInfoEXT create{};
    create.sType = VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT;
    create.buffer = storage_.handle();
    create.size = sizes.micromapSize;
    create.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    check(vk.createMicromap(device_.handle(), &create, nullptr, &micromap_), "creating a micromap");
    const VkDeviceSize alignment = std::max(kAlignment, device_.scratchAlignment());
    const Buffer scratch(device_, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                         Buffer::Place::Device);
    info.dstMicromap = micromap_;
    info.scratchData.deviceAddress = scratch.address(alignment);
    run([&](VkCommandBuffer commands) {
        vk.cmdBuildMicromaps(commands, 1, &info);
        micromapBarrier(commands);
    });
}

} // namespace

std::unique_ptr<GpuMicromap> makeExtMicromap(Device &device, const Micromap &micromap)
{
    return std::make_unique<ExtMicromap>(device, micromap);
}

} // namespace vellum::cli
