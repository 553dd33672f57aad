// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/acceleration.h"

#include <algorithm>

namespace vellum::cli
{
namespace
{

constexpr VkBufferUsageFlags kBuildInput =
    VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

// What stands at `place` in a copy that is placed so.
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

} // namespace

AccelerationStructure::AccelerationStructure(Device &device, VkAccelerationStructureTypeKHR type,
                                             std::span<const VkAccelerationStructureGeometryKHR> geometries,
                                             std::span<const uint32_t> counts)
    : AccelerationStructure(device)
{
    const DeviceFunctions &vk = device.functions();
    VkAccelerationStructureBuildGeometryInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR;
    info.type = type;
    info.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    info.geometryCount = static_cast<uint32_t>(geometries.size());
    info.pGeometries = geometries.data();
    VkAccelerationStructureBuildSizesInfoKHR sizes{};
    sizes.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR;
    vk.getAccelerationStructureBuildSizes(device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                          counts.data(), &sizes);

    storage_ =
        Buffer(device, sizes.accelerationStructureSize,
               VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
               Buffer::Place::Device);
    VkAccelerationStructureCreateInfoKHR create{};
    create.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR;
    create.buffer = storage_.handle();
    create.size = sizes.accelerationStructureSize;
    create.type = type;
    check(vk.createAccelerationStructure(device.handle(), &create, nullptr, &structure_),
          "creating an acceleration structure");
    const VkDeviceSize alignment = std::max<VkDeviceSize>(device.scratchAlignment(), 1);
    const Buffer scratch(device, sizes.buildScratchSize + alignment,
                         VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                         Buffer::Place::Device);
    info.dstAccelerationStructure = structure_;
    info.scratchData.deviceAddress = scratch.address(alignment);
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    for (const uint32_t count : counts)
        ranges.push_back({count, 0, 0, 0});
    const VkAccelerationStructureBuildRangeInfoKHR *range = ranges.data();
    device.run([&](VkCommandBuffer commands) {
        vk.cmdBuildAccelerationStructures(commands, 1, &info, &range);
        const VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr,
                                      VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                      VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                             VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
    });
}

AccelerationStructure::~AccelerationStructure()
{
    if (structure_ != VK_NULL_HANDLE)
        owner_->functions().destroyAccelerationStructure(owner_->handle(), structure_, nullptr);
}

VkDeviceAddress AccelerationStructure::address() const
{
    const VkAccelerationStructureDeviceAddressInfoKHR info{
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR, nullptr, structure_};
    return owner_->functions().getAccelerationStructureDeviceAddress(owner_->handle(), &info);
}

World::World(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps)
{
    for (const Mesh &mesh : scene.scene.meshes) {
        const auto part = [&](auto all) { return all.subspan(mesh.firstGeometry, mesh.geometryCount); };
        meshes_.push_back(buildBottom(device, part(std::span(scene.scene.geometries)), &scene.scene,
                                      micromaps.empty() ? micromaps : part(micromaps)));
    }
    ground_ = buildBottom(device, std::span(&scene.ground, 1), nullptr, {});
    buildTop(device, scene);
}

std::unique_ptr<AccelerationStructure> World::buildBottom(Device &device, std::span<const Geometry> geometries,
                                                          const Scene *materials,
                                                          std::span<const Micromap *const> micromaps)
{
    std::vector<Vec3> positions;
    std::vector<uint32_t> indices;
    for (const Geometry &g : geometries) {
        positions.insert(positions.end(), g.positions.begin(), g.positions.end());
        indices.insert(indices.end(), g.indices.begin(), g.indices.end());
    }
    const Buffer positionBuffer = uploadBuffer(device, std::as_bytes(std::span(positions)), kBuildInput);
    const Buffer indexBuffer = uploadBuffer(device, std::as_bytes(std::span(indices)), kBuildInput);
    VkDeviceAddress position = positionBuffer.address();
    VkDeviceAddress index = indexBuffer.address();
    std::vector<VkAccelerationStructureGeometryKHR> infos;
    std::vector<uint32_t> counts;
    for (size_t i = 0; i < geometries.size(); ++i) {
        const Geometry &g = geometries[i];
        VkAccelerationStructureGeometryKHR info{};
        info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
        info.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
        const bool masked = materials != nullptr && materials->materials[g.material].masked();
        info.flags = masked ? VkGeometryFlagsKHR{0} : VkGeometryFlagsKHR{VK_GEOMETRY_OPAQUE_BIT_KHR};
        VkAccelerationStructureGeometryTrianglesDataKHR &triangles = info.geometry.triangles;
        triangles.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR;
        triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
        triangles.vertexData.deviceAddress = position;
        triangles.vertexStride = sizeof(Vec3);
        triangles.maxVertex = static_cast<uint32_t>(g.positions.size() - 1);
        triangles.indexType = VK_INDEX_TYPE_UINT32;
        triangles.indexData.deviceAddress = index;
        if (i < micromaps.size() && micromaps[i] != nullptr) {
            micromaps_.push_back(makeMicromap(device, *micromaps[i]));
            triangles.pNext = micromaps_.back()->attachment();
        }
        infos.push_back(info);
        counts.push_back(static_cast<uint32_t>(g.indices.size() / 3));
        position += g.positions.size() * sizeof(Vec3);
        index += g.indices.size() * sizeof(uint32_t);
    }
    return std::make_unique<AccelerationStructure>(device, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, infos,
                                                   counts);
}

void World::buildTop(Device &device, const RenderScene &scene)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    const auto add = [&](const VkTransformMatrixKHR &transform, size_t firstRecord,
                         const AccelerationStructure &bottom) {
        VkAccelerationStructureInstanceKHR instance{};
        instance.transform = transform;
        instance.instanceCustomIndex = static_cast<uint32_t>(firstRecord) & 0xffffffu;
        instance.mask = 0xff;
        instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
        instance.accelerationStructureReference = bottom.address();
        instances.push_back(instance);
    };
    for (const Placement &copy : scene.copies)
        for (const MeshInstance &i : scene.scene.instances)
            add(matrixOf(copy, i.transform), scene.scene.meshes[i.mesh].firstGeometry, *meshes_[i.mesh]);
    add(matrixOf({}, kInPlace), scene.records.size() - 1, *ground_);

    const Buffer buffer = uploadBuffer(device, std::as_bytes(std::span(instances)), kBuildInput, 16);
    VkAccelerationStructureGeometryKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    info.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
    info.geometry.instances.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR;
    info.geometry.instances.data.deviceAddress = buffer.address(16);
    const auto count = static_cast<uint32_t>(instances.size());
    top_ = std::make_unique<AccelerationStructure>(device, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
                                                   std::span(&info, 1), std::span(&count, 1));
}

VkDeviceSize World::structureBytes() const
{
    VkDeviceSize bytes = top_->bytes() + ground_->bytes();
    for (const auto &mesh : meshes_)
        bytes += mesh->bytes();
    return bytes;
}

VkDeviceSize World::micromapBytes() const
{
    VkDeviceSize bytes = 0;
    for (const auto &micromap : micromaps_)
        bytes += micromap->bytes();
    return bytes;
}

} // namespace vellum::cli
