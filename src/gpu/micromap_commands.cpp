// SPDX-License-Identifier: Apache-2.0
#include "gpu/micromap_commands.h"

#include <algorithm>

namespace vellum::gpu
{
namespace
{

VkCopyAccelerationStructureModeKHR structureMode(VkCopyMicromapModeEXT mode)
{
    switch (mode) {
    case VK_COPY_MICROMAP_MODE_CLONE_EXT: return VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
    case VK_COPY_MICROMAP_MODE_COMPACT_EXT: return VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    case VK_COPY_MICROMAP_MODE_SERIALIZE_EXT: return VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    default: return VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
    }
}

} // namespace

VkBufferUsageFlags micromapStorageUsage(const Device &gpu)
{
    return VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
           (gpu.khr() ? VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR
                      : VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
}

VkBufferUsageFlags micromapInputUsage(const Device &gpu)
{
    return VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
           (gpu.khr() ? VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR
                      : VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT);
}

VkDeviceSize micromapInputAlignment(const Device &gpu)
{
    return gpu.khr() ? 128 : 256;
}

MicromapHandle createMicromap(const Device &gpu, VkBuffer buffer, VkDeviceAddress address, VkDeviceSize offset,
                              VkDeviceSize size, VkAccelerationStructureTypeKHR type)
{
    MicromapHandle handle;
    if (gpu.khr()) {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {address + offset, size}, .addressFlags = kUnknownUsage, .type = type});
        CHECK_VK(gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &handle.khr));
        return handle;
    }
    auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = buffer, .offset = offset, .size = size, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    CHECK_VK(gpu.vk().CreateMicromapEXT(gpu.device(), &info, nullptr, &handle.ext));
    return handle;
}

void destroyMicromap(const Device &gpu, MicromapHandle micromap)
{
    if (micromap.khr != VK_NULL_HANDLE || (gpu.khr() && micromap.ext == VK_NULL_HANDLE))
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), micromap.khr, nullptr);
    else
        gpu.vk().DestroyMicromapEXT(gpu.device(), micromap.ext, nullptr);
}

StructureBuild::StructureBuild(const VkMicromapBuildInfoEXT &ext, VkAccelerationStructureKHR target)
{
    const bool any = ext.pUsageCounts != nullptr || ext.ppUsageCounts != nullptr;
    for (uint32_t i = 0; any && i < ext.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = ext.pUsageCounts != nullptr ? ext.pUsageCounts[i] : *ext.ppUsageCounts[i];
        usages.push_back({usage.count, usage.subdivisionLevel, static_cast<VkOpacityMicromapFormatKHR>(usage.format)});
    }
    if (ext.ppUsageCounts != nullptr)
        usages = scattered(usages, usagePointers);
    else
        for (const VkMicromapUsageKHR &usage : usages)
            usagePointers.push_back(&usage);
    data = vkInit<VkAccelerationStructureGeometryMicromapDataKHR>(
        {.usageCountsCount = ext.usageCountsCount,
         .pUsageCounts = ext.pUsageCounts != nullptr ? usages.data() : nullptr,
         .ppUsageCounts = ext.ppUsageCounts != nullptr ? usagePointers.data() : nullptr,
         .data = ext.data.deviceAddress,
         .triangleArray = ext.triangleArray.deviceAddress,
         .triangleArrayStride = ext.triangleArrayStride});
    geometry =
        vkInit<VkAccelerationStructureGeometryKHR>({.pNext = &data, .geometryType = VK_GEOMETRY_TYPE_MICROMAP_KHR});
    info = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
        {.type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    if ((ext.flags & VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT) != 0)
        info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    if ((ext.flags & VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT) != 0)
        info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR;
    if ((ext.flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0)
        info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    if ((ext.flags & kLossy) != 0)
        info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    info.mode = static_cast<VkBuildAccelerationStructureModeKHR>(ext.mode);
    info.dstAccelerationStructure = target;
    info.geometryCount = 1;
    if (ext.ppUsageCounts != nullptr)
        info.ppGeometries = &geometryPointer;
    else
        info.pGeometries = &geometry;
    info.scratchData = ext.scratchData;
}

VkMicromapBuildSizesInfoEXT micromapSizes(const Device &gpu, const VkMicromapBuildInfoEXT &info, bool onHost)
{
    auto sizes = vkInit<VkMicromapBuildSizesInfoEXT>();
    const auto type = VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR;
    if (!gpu.khr()) {
        gpu.vk().GetMicromapBuildSizesEXT(
            gpu.device(), onHost ? VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_OR_DEVICE_KHR : type, &info, &sizes);
        return sizes;
    }
    const StructureBuild build(info, VK_NULL_HANDLE);
    auto khr = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    gpu.vk().GetAccelerationStructureBuildSizesKHR(gpu.device(), type, &build.info, nullptr, &khr);
    sizes.micromapSize = khr.accelerationStructureSize;
    sizes.buildScratchSize = khr.buildScratchSize;
    return sizes;
}

VkDeviceSize reportedSize(const Device &gpu, VkDeviceSize bytes)
{
    return gpu.khr() ? (bytes + 255 - 64) / 256 * 256 + 64 : bytes;
}

void recordMicromapBuilds(const Device &gpu, VkCommandBuffer commands, std::span<const MicromapBuild> builds,
                          const OtherBuilds &others)
{
    const auto count = static_cast<uint32_t>(builds.size());
    if (!gpu.khr()) {
        std::vector<VkMicromapBuildInfoEXT> infos;
        for (const MicromapBuild &build : builds) {
            infos.push_back(build.info);
            infos.back().dstMicromap = build.target.ext;
        }
        gpu.vk().CmdBuildMicromapsEXT(commands, count, infos.data());
        return;
    }
    std::vector<std::unique_ptr<StructureBuild>> structures;
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    // Ignored for micromaps, but there must be as many.
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges;
    for (size_t i = 0; i < std::max(builds.size(), others.infos.size()); ++i) {
        if (i < builds.size()) {
            structures.push_back(std::make_unique<StructureBuild>(builds[i].info, builds[i].target.khr));
            infos.push_back(structures.back()->info);
            ranges.push_back(nullptr);
        }
        if (i < others.infos.size()) {
            infos.push_back(others.infos[i]);
            ranges.push_back(others.ranges[i]);
        }
    }
    gpu.vk().CmdBuildAccelerationStructuresKHR(commands, static_cast<uint32_t>(infos.size()), infos.data(),
                                               ranges.data());
}

void recordMicromapCopy(const Device &gpu, VkCommandBuffer commands, MicromapHandle from, MicromapHandle to,
                        VkCopyMicromapModeEXT mode)
{
    if (gpu.khr()) {
        auto info =
            vkInit<VkCopyAccelerationStructureInfoKHR>({.src = from.khr, .dst = to.khr, .mode = structureMode(mode)});
        gpu.vk().CmdCopyAccelerationStructureKHR(commands, &info);
        return;
    }
    auto info = vkInit<VkCopyMicromapInfoEXT>({.src = from.ext, .dst = to.ext, .mode = mode});
    gpu.vk().CmdCopyMicromapEXT(commands, &info);
}

void recordMicromapToMemory(const Device &gpu, VkCommandBuffer commands, MicromapHandle from, VkDeviceAddress to,
                            VkCopyMicromapModeEXT mode)
{
    if (gpu.khr()) {
        auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = from.khr});
        info.dst.deviceAddress = to;
        info.mode = structureMode(mode);
        gpu.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
        return;
    }
    auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = from.ext});
    info.dst.deviceAddress = to;
    info.mode = mode;
    gpu.vk().CmdCopyMicromapToMemoryEXT(commands, &info);
}

void recordMemoryToMicromap(const Device &gpu, VkCommandBuffer commands, VkDeviceAddress from, MicromapHandle to,
                            VkCopyMicromapModeEXT mode)
{
    if (gpu.khr()) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = from;
        info.dst = to.khr;
        info.mode = structureMode(mode);
        gpu.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
        return;
    }
    auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>();
    info.src.deviceAddress = from;
    info.dst = to.ext;
    info.mode = mode;
    gpu.vk().CmdCopyMemoryToMicromapEXT(commands, &info);
}

VkQueryType micromapQueryType(const Device &gpu, VkQueryType type)
{
    if (gpu.khr() && type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
        return VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    if (gpu.khr() && type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT)
        return VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR;
    return type;
}

void recordMicromapProperties(const Device &gpu, VkCommandBuffer commands, std::span<const MicromapHandle> micromaps,
                              VkQueryType type, VkQueryPool pool, uint32_t first)
{
    std::vector<VkMicromapEXT> ext;
    std::vector<VkAccelerationStructureKHR> khr;
    for (const MicromapHandle &micromap : micromaps) {
        ext.push_back(micromap.ext);
        khr.push_back(micromap.khr);
    }
    const auto count = static_cast<uint32_t>(micromaps.size());
    if (gpu.khr())
        gpu.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, count, khr.data(), type, pool, first);
    else
        gpu.vk().CmdWriteMicromapsPropertiesEXT(commands, count, ext.data(), type, pool, first);
}

VkDeviceSize queryMicromap(Device &gpu, MicromapHandle micromap, VkQueryType type)
{
    const QueryPool pool(gpu, micromapQueryType(gpu, type));
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        recordMicromapProperties(gpu, commands, std::span(&micromap, 1), pool.type(), pool, 0);
    });
    return pool.value();
}

template <class Command>
void HostCommands::run(const Command &command) const
{
    if (!deferred_)
        return checkResult(command(VK_NULL_HANDLE), "a host command of micromaps");
    VkResult returned = VK_SUCCESS;
    checkResult(deferred(gpu_, [&](VkDeferredOperationKHR operation) { return returned = command(operation); }),
                "a deferred host command of micromaps");
    // vkBuildMicromapsEXT and others, Return Codes: VK_OPERATION_DEFERRED_KHR, VK_OPERATION_NOT_DEFERRED_KHR
    if (returned == VK_SUCCESS)
        throw std::runtime_error("a host command of micromaps returns VK_SUCCESS although it has a deferred operation");
}

void HostCommands::build(std::span<const VkMicromapBuildInfoEXT> infos) const
{
    run([&](VkDeferredOperationKHR operation) {
        return gpu_.vk().BuildMicromapsEXT(gpu_.device(), operation, static_cast<uint32_t>(infos.size()), infos.data());
    });
}

void HostCommands::copy(VkMicromapEXT from, VkMicromapEXT to, VkCopyMicromapModeEXT mode) const
{
    const auto info = vkInit<VkCopyMicromapInfoEXT>({.src = from, .dst = to, .mode = mode});
    run([&](VkDeferredOperationKHR operation) { return gpu_.vk().CopyMicromapEXT(gpu_.device(), operation, &info); });
}

void HostCommands::toMemory(VkMicromapEXT from, void *to) const
{
    auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = from});
    info.dst.hostAddress = to;
    info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    run([&](VkDeferredOperationKHR operation) {
        return gpu_.vk().CopyMicromapToMemoryEXT(gpu_.device(), operation, &info);
    });
}

void HostCommands::toMicromap(const void *from, VkMicromapEXT to) const
{
    auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>();
    info.src.hostAddress = from;
    info.dst = to;
    info.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    run([&](VkDeferredOperationKHR operation) {
        return gpu_.vk().CopyMemoryToMicromapEXT(gpu_.device(), operation, &info);
    });
}

std::vector<VkDeviceSize> HostCommands::sizes(std::span<const VkMicromapEXT> micromaps, VkQueryType type,
                                              size_t stride) const
{
    constexpr uint8_t kGuard = 0x5a;
    std::vector<uint8_t> data(micromaps.size() * stride, kGuard);
    CHECK_VK(gpu_.vk().WriteMicromapsPropertiesEXT(gpu_.device(), static_cast<uint32_t>(micromaps.size()),
                                                   micromaps.data(), type, data.size(), data.data(), stride));
    std::vector<VkDeviceSize> sizes(micromaps.size());
    for (size_t i = 0; i < sizes.size(); ++i) {
        const auto at = data.begin() + static_cast<ptrdiff_t>(i * stride);
        std::memcpy(&sizes[i], &*at, sizeof(VkDeviceSize));
        if (std::any_of(at + sizeof(VkDeviceSize), at + static_cast<ptrdiff_t>(stride),
                        [](uint8_t byte) { return byte != kGuard; }))
            gpu_.fault("vkWriteMicromapsPropertiesEXT wrote between two sizes");
    }
    return sizes;
}

bool micromapIsCompatible(const Device &gpu, const uint8_t *version)
{
    auto result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_MAX_ENUM_KHR;
    if (gpu.khr()) {
        auto info = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = version});
        gpu.vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu.device(), &info, &result);
    } else {
        auto info = vkInit<VkMicromapVersionInfoEXT>({.pVersionData = version});
        gpu.vk().GetDeviceMicromapCompatibilityEXT(gpu.device(), &info, &result);
    }
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

} // namespace vellum::gpu
