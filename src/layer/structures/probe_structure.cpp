#include "layer/structures/probe_structure.h"

#include <cstring>

#include "layer/structures/structure_layout.h"

namespace vellum::layer
{

ProbeStructure::~ProbeStructure()
{
    if (handle_)
        context_.next->DestroyAccelerationStructureKHR(context_.device, handle_, nullptr);
}

bool ProbeStructure::makeInput(const void *data, size_t bytes)
{
    if (input_.create(context_, bytes, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR) !=
        VK_SUCCESS)
        return false;
    std::memcpy(input_.words(), data, bytes);
    return true;
}

bool ProbeStructure::buildTriangle(VkCommandBuffer commands, VkGeometryFlagsKHR flags, VkDeviceSize spareBytes)
{
    constexpr float kVertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    if (!makeInput(kVertices, sizeof kVertices))
        return false;
    VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
    geometry.flags = flags;
    VkAccelerationStructureGeometryTrianglesDataKHR &triangles = geometry.geometry.triangles;
    triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
    triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    triangles.vertexData.deviceAddress = input_.address();
    triangles.vertexStride = 3 * sizeof(float);
    triangles.maxVertex = 2;
    triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
    return build(commands, geometry, spareBytes);
}

bool ProbeStructure::build(VkCommandBuffer commands, const VkAccelerationStructureGeometryKHR &geometry,
                           VkDeviceSize spareBytes)
{
    const DeviceTable &next = *context_.next;
    VkAccelerationStructureBuildGeometryInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    const uint32_t one = 1;
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    next.GetAccelerationStructureBuildSizesKHR(context_.device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                               &one, &sizes);
    size_ = sizes.accelerationStructureSize + spareBytes;
    if (memory_.create(context_, size_, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) != VK_SUCCESS ||
        scratch_.create(context_, sizes.buildScratchSize + kPartAlignment) != VK_SUCCESS)
        return false;
    VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    create.buffer = memory_.buffer();
    create.size = size_;
    create.type = info.type;
    if (next.CreateAccelerationStructureKHR(context_.device, &create, nullptr, &handle_) != VK_SUCCESS)
        return false;
    info.dstAccelerationStructure = handle_;
    info.scratchData.deviceAddress = alignUp(scratch_.address(), kPartAlignment);
    const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    next.CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_MEMORY_WRITE_BIT,
                                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT};
    next.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1,
                            &memory, 0, nullptr, 0, nullptr);
    return true;
}

} // namespace vellum::layer
