// SPDX-License-Identifier: Apache-2.0
#include "world.h"

#include <algorithm>
#include <array>
#include <utility>

namespace stress
{
namespace
{

using namespace vt;

constexpr uint32_t kLevels = 5;
constexpr VkBuildAccelerationStructureFlagsKHR kFlags =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT;
constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags kSerializedUsage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | kAddress;
constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | kAddress;

uint32_t dataBytes(uint32_t level, uint16_t format)
{
    return ((1u << (2 * level)) * (format == kTwoState ? 1 : 2) + 7) / 8;
}

// Index of a triangle into its micromap, by one of three formulas for each geometry. Negative: special.
int32_t indexOf(uint32_t geometry, uint32_t triangle, uint32_t triangles)
{
    if (geometry % 3 == 0)
        return static_cast<int32_t>(triangle);
    if (triangle % 10 == 9)
        return -1 - static_cast<int32_t>(mix(geometry, triangle) % 4);
    return static_cast<int32_t>((triangle * 7 + geometry) % triangles);
}

} // namespace

uint32_t mix(uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t h = a * 0x9e3779b1u ^ b * 0x85ebca6bu ^ c * 0xc2b2ae35u;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return h ^ h >> 15;
}

uint32_t levelOf(uint32_t micromap, uint32_t triangle)
{
    return mix(micromap, triangle, 1) % (kLevels + 1);
}

uint16_t formatOf(uint32_t micromap, uint32_t triangle)
{
    return mix(micromap, triangle, 2) % 3 == 0 ? kTwoState : kFourState;
}

uint8_t stateOf(uint32_t micromap, uint32_t version, uint32_t triangle, uint32_t index)
{
    const uint32_t seed = mix(micromap, triangle, version + 3);
    // Some triangles have one state, some few runs of states, some mixed ones.
    const uint32_t place = seed % 4 == 0 ? 0 : seed % 4 == 1 ? index / 16 : index;
    return static_cast<uint8_t>(mix(seed, place) % (formatOf(micromap, triangle) == kTwoState ? 2 : 4));
}

// The inputs of a structure's build; `info` points into this object.
struct World::Description {
    Description(const World &world, uint32_t blas, VkBuildAccelerationStructureModeKHR mode)
    {
        const Extent &extent = world.extent_;
        geometries.resize(extent.geometries);
        attachments.resize(extent.geometries);
        attachmentsKhr.resize(extent.geometries);
        usages.resize(extent.geometries);
        counts.assign(extent.geometries, extent.triangles);
        ranges.assign(extent.geometries, {extent.triangles, 0, 0, 0});
        for (uint32_t g = 0; g < extent.geometries; ++g)
            describe(world, blas, g);
        info = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
            {.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
             .flags = kFlags,
             .mode = mode,
             .geometryCount = extent.geometries,
             .pGeometries = geometries.data()});
        if (world.scratch_.size() != 0)
            info.scratchData.deviceAddress = world.scratch_.address();
    }
    Description(const Description &) = delete;
    Description &operator=(const Description &) = delete;

    void describe(const World &world, uint32_t blas, uint32_t g)
    {
        const Extent &extent = world.extent_;
        const uint32_t map = blas * extent.geometries + g;
        std::array<uint32_t, 2 * (kLevels + 1)> used{};
        for (uint32_t t = 0; t < extent.triangles; ++t) {
            if (const int32_t index = indexOf(g, t, extent.triangles); index >= 0) {
                const auto triangle = static_cast<uint32_t>(index);
                ++used[levelOf(map, triangle) * 2 + (formatOf(map, triangle) == kTwoState ? 1 : 0)];
            }
        }
        for (uint32_t u = 0; u < used.size(); ++u) {
            if (used[u] != 0)
                usages[g].push_back({used[u], u / 2, u % 2 == 1 ? kTwoState : uint32_t{kFourState}});
        }
        VkAccelerationStructureTrianglesOpacityMicromapEXT &attachment = attachments[g];
        attachment = vkInit<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
            {.indexType = g % 3 == 0 ? VK_INDEX_TYPE_NONE_KHR : VK_INDEX_TYPE_UINT32});
        if (g % 3 != 0) {
            attachment.indexBuffer.deviceAddress = world.indices_.address() + VkDeviceSize{g} * extent.triangles * 4;
            attachment.indexStride = 4;
        }
        attachment.usageCountsCount = static_cast<uint32_t>(usages[g].size());
        attachment.pUsageCounts = usages[g].data();
        attachment.micromap = world.micromaps_[map].handle.ext;
        VkAccelerationStructureTrianglesOpacityMicromapKHR &khr = attachmentsKhr[g];
        khr = vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>(
            {.indexType = attachment.indexType,
             .indexBuffer = attachment.indexBuffer.deviceAddress,
             .indexStride = attachment.indexStride,
             .micromap = world.micromaps_[map].handle.khr});
        VkAccelerationStructureGeometryKHR &geometry = geometries[g];
        geometry =
            vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
                                                        .flags = opaque(g) ? VkFlags{VK_GEOMETRY_OPAQUE_BIT_KHR} : 0});
        VkAccelerationStructureGeometryTrianglesDataKHR &triangles = geometry.geometry.triangles;
        triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>(
            {.pNext = world.gpu_.khr() ? static_cast<const void *>(&khr) : &attachment,
             .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
             .vertexStride = sizeof(Vec3),
             .maxVertex = 3 * extent.triangles - 1});
        triangles.vertexData.deviceAddress =
            world.vertices_.address() + VkDeviceSize{g} * extent.triangles * 3 * sizeof(Vec3);
        triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
    }

    std::vector<VkAccelerationStructureGeometryKHR> geometries;
    std::vector<VkAccelerationStructureTrianglesOpacityMicromapEXT> attachments;
    std::vector<VkAccelerationStructureTrianglesOpacityMicromapKHR> attachmentsKhr;
    std::vector<std::vector<VkMicromapUsageEXT>> usages;
    std::vector<uint32_t> counts;
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    VkAccelerationStructureBuildGeometryInfoKHR info{};
};

namespace
{

// A micromap build; `info` points into this object.
struct MicromapDescription {
    MicromapDescription(uint32_t micromap, uint32_t triangles)
    {
        std::array<uint32_t, 2 * (kLevels + 1)> used{};
        for (uint32_t t = 0; t < triangles; ++t)
            ++used[levelOf(micromap, t) * 2 + (formatOf(micromap, t) == kTwoState ? 1 : 0)];
        for (uint32_t u = 0; u < used.size(); ++u) {
            if (used[u] != 0)
                usage.push_back({used[u], u / 2, u % 2 == 1 ? kTwoState : uint32_t{kFourState}});
        }
        info = vkInit<VkMicromapBuildInfoEXT>({.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT,
                                               .flags = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT,
                                               .mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT,
                                               .usageCountsCount = static_cast<uint32_t>(usage.size()),
                                               .pUsageCounts = usage.data()});
    }
    MicromapDescription(const MicromapDescription &) = delete;
    MicromapDescription &operator=(const MicromapDescription &) = delete;
    std::vector<VkMicromapUsageEXT> usage;
    VkMicromapBuildInfoEXT info{};
};

} // namespace

World::World(Gpu &gpu, const Extent &extent)
    : gpu_(gpu), extent_(extent), micromaps_(extent.micromaps()), blases_(extent.blases)
{
    makeGeometry();
    VkDeviceSize scratch = 0;
    for (uint32_t m = 0; m < extent_.micromaps(); ++m) {
        const MicromapDescription description(m, extent_.triangles);
        const VkMicromapBuildSizesInfoEXT sizes = micromapSizes(gpu_, description.info);
        micromapBytes_ = std::max(micromapBytes_, sizes.micromapSize);
        scratch = std::max(scratch, sizes.buildScratchSize);
    }
    {
        const Description description(*this, 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
        auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
        gpu_.vk().GetAccelerationStructureBuildSizesKHR(gpu_.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                        &description.info, description.counts.data(), &sizes);
        blasBytes_ = sizes.accelerationStructureSize;
        scratch = std::max({scratch, sizes.buildScratchSize, sizes.updateScratchSize});
    }
    scratch_ = Guarded(gpu_, scratch, gpu_.scratchAlignment(), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | kAddress);
    for (uint32_t m = 0; m < extent_.micromaps(); ++m)
        buildMicromap(m);
    for (uint32_t b = 0; b < extent_.blases; ++b)
        build(b, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
}

World::~World()
{
    for (Bottom &blas : blases_)
        destroy(std::move(blas));
    for (Map &micromap : micromaps_)
        destroy(std::move(micromap));
}

void World::destroy(Bottom blas)
{
    gpu_.vk().DestroyAccelerationStructureKHR(gpu_.device(), blas.handle, nullptr);
}

void World::destroy(Map micromap)
{
    destroyMicromap(gpu_, micromap.handle);
}

void World::makeGeometry()
{
    std::vector<Vec3> vertices;
    std::vector<int32_t> indices;
    for (uint32_t g = 0; g < extent_.geometries; ++g) {
        const std::vector<Vec3> row = triangleRow(extent_.triangles, {0, 2 * static_cast<float>(g), 0});
        vertices.insert(vertices.end(), row.begin(), row.end());
        for (uint32_t t = 0; t < extent_.triangles; ++t)
            indices.push_back(indexOf(g, t, extent_.triangles));
    }
    vertices_ = uploadAligned(gpu_, vertices.data(), vertices.size() * sizeof(Vec3), kInput, 4);
    indices_ = uploadAligned(gpu_, indices.data(), indices.size() * sizeof(int32_t), kInput, 4);
    const VkDeviceSize alignment = micromapInputAlignment(gpu_);
    data_ = Guarded(gpu_, VkDeviceSize{extent_.triangles} * dataBytes(kLevels, kFourState), alignment,
                    micromapInputUsage(gpu_));
    triangles_ = Guarded(gpu_, VkDeviceSize{extent_.triangles} * sizeof(VkMicromapTriangleEXT), alignment,
                         micromapInputUsage(gpu_));
}

void World::fillInput(uint32_t micromap, uint32_t version)
{
    uint8_t *const data = data_.bytes();
    auto *const triangles = reinterpret_cast<VkMicromapTriangleEXT *>(triangles_.bytes());
    uint32_t offset = 0;
    for (uint32_t t = 0; t < extent_.triangles; ++t) {
        const uint32_t level = levelOf(micromap, t);
        const uint16_t format = formatOf(micromap, t);
        const uint32_t bits = format == kTwoState ? 1 : 2;
        std::memset(data + offset, 0, dataBytes(level, format));
        for (uint32_t i = 0; i < 1u << (2 * level); ++i) {
            uint8_t &byte = data[offset + i * bits / 8];
            byte = static_cast<uint8_t>(byte | stateOf(micromap, version, t, i) << (i * bits % 8));
        }
        triangles[t] = {offset, static_cast<uint16_t>(level), format};
        offset += dataBytes(level, format);
    }
}

World::Map World::replaceMicromap(uint32_t micromap, VkDeviceSize bytes)
{
    Map map;
    map.version = micromaps_[micromap].version;
    map.memory = Guarded(gpu_, bytes, 256, micromapStorageUsage(gpu_));
    map.handle = createMicromap(gpu_, map.memory.buffer(), map.memory.address() - map.memory.offset(),
                                map.memory.offset(), map.memory.handleSize(),
                                map.memory.handleSize() != bytes ? VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR
                                                                 : VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    return std::exchange(micromaps_[micromap], std::move(map));
}

void World::buildMicromap(uint32_t micromap)
{
    // A compacted or loaded micromap has too little capacity for a rebuild.
    if (micromaps_[micromap].memory.size() < micromapBytes_)
        destroy(replaceMicromap(micromap, micromapBytes_));
    fillInput(micromap, micromaps_[micromap].version);
    MicromapDescription description(micromap, extent_.triangles);
    description.info.data.deviceAddress = data_.address();
    description.info.triangleArray.deviceAddress = triangles_.address();
    description.info.triangleArrayStride = sizeof(VkMicromapTriangleEXT);
    description.info.scratchData.deviceAddress = scratch_.address();
    const MicromapBuild build{description.info, micromaps_[micromap].handle};
    gpu_.submit([&](VkCommandBuffer commands) { recordMicromapBuilds(gpu_, commands, std::span(&build, 1)); });
}

VkDeviceSize World::queriedSize(uint32_t micromap, VkQueryType type)
{
    const QueryPool pool(gpu_, micromapQueryType(gpu_, type));
    gpu_.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        recordMicromapProperties(gpu_, commands, std::span(&micromaps_[micromap].handle, 1), pool.type(), pool, 0);
    });
    return pool.value();
}

VkDeviceSize World::queriedSize(VkAccelerationStructureKHR blas, VkQueryType type)
{
    const QueryPool pool(gpu_, type);
    gpu_.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        gpu_.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &blas, type, pool, 0);
    });
    return pool.value();
}

void World::copyMicromap(uint32_t micromap, VkCopyMicromapModeEXT mode)
{
    const Map &map = micromaps_[micromap];
    const VkDeviceSize bytes = mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT
                                   ? queriedSize(micromap, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
                                   : map.memory.size();
    Map old = replaceMicromap(micromap, bytes);
    gpu_.submit([&](VkCommandBuffer commands) { recordMicromapCopy(gpu_, commands, old.handle, map.handle, mode); });
    destroy(std::move(old));
}

void World::reloadMicromap(uint32_t micromap)
{
    const Map &map = micromaps_[micromap];
    const Guarded memory(gpu_, queriedSize(micromap, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT), 256,
                         kSerializedUsage);
    gpu_.submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu_, commands, map.handle, memory.address()); });
    uint64_t size = 0;
    std::memcpy(&size, memory.bytes() + 40, 8);
    destroy(replaceMicromap(micromap, size));
    gpu_.submit(
        [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu_, commands, memory.address(), map.handle); });
}

World::Bottom World::replaceBlas(uint32_t blas, VkDeviceSize bytes)
{
    Bottom bottom;
    bottom.memory = Guarded(gpu_, bytes, 256, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | kAddress);
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = bottom.memory.buffer(), .offset = bottom.memory.offset(), .size = bottom.memory.handleSize()});
    info.type = info.size != bytes ? VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR
                                   : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    VT_CHECK(gpu_.vk().CreateAccelerationStructureKHR(gpu_.device(), &info, nullptr, &bottom.handle));
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = bottom.handle});
    bottom.address = gpu_.vk().GetAccelerationStructureDeviceAddressKHR(gpu_.device(), &query);
    return std::exchange(blases_[blas], std::move(bottom));
}

void World::build(uint32_t blas, VkBuildAccelerationStructureModeKHR mode)
{
    const bool update = mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    if (blases_[blas].memory.size() < blasBytes_ && !update)
        destroy(replaceBlas(blas, blasBytes_));
    Description description(*this, blas, mode);
    description.info.dstAccelerationStructure = blases_[blas].handle;
    if (update)
        description.info.srcAccelerationStructure = blases_[blas].handle;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = description.ranges.data();
    gpu_.submit([&](VkCommandBuffer commands) {
        gpu_.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &description.info, &ranges);
    });
}

void World::copy(uint32_t blas, VkCopyAccelerationStructureModeKHR mode)
{
    const VkDeviceSize bytes =
        mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR
            ? queriedSize(blases_[blas].handle, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
            : blases_[blas].memory.size();
    Bottom old = replaceBlas(blas, bytes);
    gpu_.submit([&](VkCommandBuffer commands) {
        auto info =
            vkInit<VkCopyAccelerationStructureInfoKHR>({.src = old.handle, .dst = blases_[blas].handle, .mode = mode});
        gpu_.vk().CmdCopyAccelerationStructureKHR(commands, &info);
    });
    destroy(std::move(old));
}

void World::reload(uint32_t blas)
{
    const Guarded memory(gpu_,
                         queriedSize(blases_[blas].handle, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR),
                         256, kSerializedUsage);
    gpu_.submit([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = blases_[blas].handle});
        info.dst.deviceAddress = memory.address();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        gpu_.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
    });
    uint64_t size = 0;
    std::memcpy(&size, memory.bytes() + 40, 8);
    destroy(replaceBlas(blas, size));
    gpu_.submit([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = memory.address();
        info.dst = blases_[blas].handle;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu_.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
}

void World::change(uint32_t blas, Change change, uint32_t geometry)
{
    const uint32_t micromap = blas * extent_.geometries + geometry;
    switch (change) {
    case Change::DataUpdate:
        ++micromaps_[micromap].version;
        buildMicromap(micromap);
        build(blas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        break;
    case Change::MicromapClone:
        copyMicromap(micromap, VK_COPY_MICROMAP_MODE_CLONE_EXT);
        build(blas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        break;
    case Change::MicromapCompact:
        copyMicromap(micromap, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        build(blas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        break;
    case Change::MicromapReload:
        reloadMicromap(micromap);
        build(blas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        break;
    case Change::Rebuild: build(blas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR); break;
    case Change::Clone: copy(blas, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR); break;
    case Change::Compact: copy(blas, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR); break;
    default: reload(blas); break;
    }
}

World::Place World::place(uint32_t blas, uint32_t geometry, uint32_t triangle, uint32_t index) const
{
    const uint32_t map = blas * extent_.geometries + geometry;
    const int32_t record = indexOf(geometry, triangle, extent_.triangles);
    Place place{};
    std::array<double, 2> centre{0.3, 0.3};
    if (record < 0) {
        place.state = -1 - record;
    } else {
        const auto t = static_cast<uint32_t>(record);
        const uint32_t level = levelOf(map, t);
        index %= 1u << (2 * level);
        centre = microTriangleCentre(index, level);
        place.state = stateOf(map, micromaps_[map].version, t, index);
    }
    place.point = {1.5f * static_cast<float>(triangle) + static_cast<float>(centre[0]),
                   2 * static_cast<float>(geometry) + static_cast<float>(centre[1]), 0};
    return place;
}

} // namespace stress
