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

    [[nodiscard]] const void *attachment() const override { return &m_attachment; }

private:
    void build(const Micromap &micromap);
    void create(VkDeviceSize size);

    Buffer m_storage;
    VkAccelerationStructureKHR m_micromap = VK_NULL_HANDLE;
    VkAccelerationStructureTrianglesOpacityMicromapKHR m_attachment{};
};

KhrMicromap::KhrMicromap(Device &device, const Micromap &micromap) : GpuMicromap(device, micromap)
{
    if (!micromap.triangles.empty())
        build(micromap);
    m_attachment.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;
    m_attachment.indexType = VK_INDEX_TYPE_UINT32;
    m_attachment.indexBuffer = m_indices.address();
    m_attachment.indexStride = sizeof(std::int32_t);
    m_attachment.baseTriangle = micromap.baseTriangle;
    m_attachment.micromap = m_micromap;
}

KhrMicromap::~KhrMicromap()
{
    if (m_micromap != VK_NULL_HANDLE)
        m_device.functions().destroyAccelerationStructure(m_device.handle(), m_micromap, nullptr);
}

void KhrMicromap::build(const Micromap &micromap)
{
    static_assert(sizeof(MicromapTriangle) == sizeof(VkMicromapTriangleKHR));
    const VkBufferUsageFlags input = kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Buffer data = uploadBuffer(m_device, std::as_bytes(std::span(micromap.data)), input, kInputAlignment);
    const Buffer triangles =
        uploadBuffer(m_device, std::as_bytes(std::span(micromap.triangles)), input, kInputAlignment);
    const std::vector<VkMicromapUsageKHR> usage = toVulkan(micromap.buildUsage());

    VkAccelerationStructureGeometryMicromapDataKHR source{};
    source.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR;
    source.usageCountsCount = static_cast<std::uint32_t>(usage.size());
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
    const DeviceFunctions &vk = m_device.functions();
    vk.getAccelerationStructureBuildSizes(m_device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                          nullptr, &sizes);

    create(sizes.accelerationStructureSize);
    const VkDeviceSize alignment = std::max<VkDeviceSize>(m_device.scratchAlignment(), 1);
    const Buffer scratch(m_device, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                         Buffer::Place::Device);
    info.dstAccelerationStructure = m_micromap;
    info.scratchData.deviceAddress = scratch.address(alignment);
    // How much there is to build, the usage counts say.
    const VkAccelerationStructureBuildRangeInfoKHR range{};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    m_device.run([&](VkCommandBuffer commands) {
        vk.cmdBuildAccelerationStructures(commands, 1, &info, &ranges);
        buildBarrier(commands);
    });
}

void KhrMicromap::create(VkDeviceSize size)
{
    m_micromapBytes = size;
    m_storage = Buffer(m_device, size + kStructureAlignment,
                       kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, Buffer::Place::Device);
    VkAccelerationStructureCreateInfo2KHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR;
    info.addressRange = {m_storage.address(kStructureAlignment), size};
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    check(m_device.functions().createAccelerationStructure2(m_device.handle(), &info, nullptr, &m_micromap),
          "creating a micromap");
}

} // namespace

std::unique_ptr<GpuMicromap> makeKhrMicromap(Device &device, const Micromap &micromap)
{
    return std::make_unique<KhrMicromap>(device, micromap);
}

} // namespace vellum::cli
