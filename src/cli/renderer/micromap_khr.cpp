// SPDX-License-Identifier: Apache-2.0
// Micromaps as acceleration structures: VK_KHR_opacity_micromap.
#include <algorithm>

#include "cli/renderer/acceleration.h"

namespace vellum::cli
{
namespace
{

// Of data and triangle addresses (VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552).
constexpr VkDeviceSize kInputAlignment = 128;
// Of the structure itself (VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605).
constexpr VkDeviceSize kStructureAlignment = 256;

constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

std::vector<VkMicromapUsageKHR> toVulkan(const std::vector<MicromapUsage> &usages)
{
    std::vector<VkMicromapUsageKHR> result;
    for (const MicromapUsage &u : usages)
        result.push_back({u.count, u.subdivisionLevel, static_cast<VkOpacityMicromapFormatKHR>(u.format)});
    return result;
}

// Between the micromap's build and the build of the acceleration structure that refers to it.
void buildBarrier(VkCommandBuffer commands)
{
    const VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                   nullptr,
                                   VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                   VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                   VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                   VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR};
    VkDependencyInfo dependency{};
    dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &barrier;
    vkCmdPipelineBarrier2(commands, &dependency);
}

class KhrMicromap final : public GpuMicromap
{
public:
    KhrMicromap(Device &device, const Micromap &micromap);
    ~KhrMicromap() override;
    KhrMicromap(const KhrMicromap &) = delete;
    KhrMicromap &operator=(const KhrMicromap &) = delete;

    [[nodiscard]] const void *attachment() const override { return &attachment_; }

private:
    void build(const Micromap &micromap);
    void create(VkDeviceSize size);

    Buffer storage_;
    VkAccelerationStructureKHR micromap_ = VK_NULL_HANDLE;
    VkAccelerationStructureTrianglesOpacityMicromapKHR attachment_{};
};

KhrMicromap::KhrMicromap(Device &device, const Micromap &micromap) : GpuMicromap(device, micromap)
{
    if (!micromap.triangles.empty())
        build(micromap);
    attachment_.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;
    attachment_.indexType = VK_INDEX_TYPE_UINT32;
    attachment_.indexBuffer = indices_.address();
    attachment_.indexStride = sizeof(int32_t);
    attachment_.baseTriangle = micromap.baseTriangle;
    attachment_.micromap = micromap_;
}

KhrMicromap::~KhrMicromap()
{
    if (micromap_ != VK_NULL_HANDLE)
        device_.functions().destroyAccelerationStructure(device_.handle(), micromap_, nullptr);
}

void KhrMicromap::build(const Micromap &micromap)
{
    static_assert(sizeof(MicromapTriangle) == sizeof(VkMicromapTriangleKHR));
    const VkBufferUsageFlags input = kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Buffer data = uploadBuffer(device_, std::as_bytes(std::span(micromap.data)), input, kInputAlignment);
    const Buffer triangles =
        uploadBuffer(device_, std::as_bytes(std::span(micromap.triangles)), input, kInputAlignment);
    const std::vector<VkMicromapUsageKHR> usage = toVulkan(micromap.buildUsage());

    VkAccelerationStructureGeometryMicromapDataKHR source{};
    source.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR;
    source.usageCountsCount = static_cast<uint32_t>(usage.size());
    source.pUsageCounts = usage.data();
    source.data = data.address(kInputAlignment);
    source.triangleArray = triangles.address(kInputAlignment);
    source.triangleArrayStride = sizeof(VkMicromapTriangleKHR);
    VkAccelerationStructureGeometryKHR geometry{};
    geometry.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    geometry.pNext = &source;
    geometry.geometryType = VK_GEOMETRY_TYPE_MICROMAP_KHR;
    VkAccelerationStructureBuildGeometryInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR;
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    info.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    VkAccelerationStructureBuildSizesInfoKHR sizes{};
    sizes.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR;
    const DeviceFunctions &vk = device_.functions();
    vk.getAccelerationStructureBuildSizes(device_.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                          nullptr, &sizes);

    create(sizes.accelerationStructureSize);
    const VkDeviceSize alignment = std::max<VkDeviceSize>(device_.scratchAlignment(), 1);
    const Buffer scratch(device_, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                         Buffer::Place::Device);
    info.dstAccelerationStructure = micromap_;
    info.scratchData.deviceAddress = scratch.address(alignment);
    // How much there is to build, the usage counts say.
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr; // a micromap has none
    run([&](VkCommandBuffer commands) {
        vk.cmdBuildAccelerationStructures(commands, 1, &info, &ranges);
        buildBarrier(commands);
    });
}

void KhrMicromap::create(VkDeviceSize size)
{
    micromapBytes_ = size;
    storage_ = Buffer(device_, size + kStructureAlignment,
                      kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, Buffer::Place::Device);
    VkAccelerationStructureCreateInfo2KHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR;
    info.addressRange = {storage_.address(kStructureAlignment), size};
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    check(device_.functions().createAccelerationStructure2(device_.handle(), &info, nullptr, &micromap_),
          "creating a micromap");
}

} // namespace

std::unique_ptr<GpuMicromap> makeKhrMicromap(Device &device, const Micromap &micromap)
{
    return std::make_unique<KhrMicromap>(device, micromap);
}

} // namespace vellum::cli
