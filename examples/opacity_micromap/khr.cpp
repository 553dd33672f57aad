// SPDX-License-Identifier: Apache-2.0
// An opacity micromap baked by libvellum, built by VK_KHR_opacity_micromap, attached to a bottom level and traced.
// usage: opacity_micromap_khr [opaque]    opaque: of a card that is opaque all over, which needs no micromap
#include <cstdlib>
#include <exception>
#include <iostream>

#include <vellum/vulkan_opacity_micromap.h> // vulkan.h, and what headers before 1.4.360 lack

#include "context.h"
#include "leaf.h"
#include "report.h"

namespace
{

// Builds a micromap from the result of a bake, if it needs one. It must live as long as the bottom levels that refer to
// it.
VkAccelerationStructureKHR buildMicromap(Context &context, const vellum::Micromap &baked)
{
    if (baked.triangles().empty())
        return VK_NULL_HANDLE; // every index is special

    constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Buffer data = context.upload(baked.data(), kInput);           // at a multiple of 128 bytes
    const Buffer triangles = context.upload(baked.triangles(), kInput); // at a multiple of 128 bytes
    std::vector<VkMicromapUsageKHR> usages;
    for (const vellum::MicromapUsage &usage : baked.usages())
        usages.push_back({usage.count, usage.subdivisionLevel, static_cast<VkOpacityMicromapFormatKHR>(usage.format)});

    // [build]
    const VkAccelerationStructureGeometryMicromapDataKHR micromapData{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR,
        .usageCountsCount = static_cast<uint32_t>(usages.size()),
        .pUsageCounts = usages.data(),
        .data = data.address,
        .triangleArray = triangles.address,
        .triangleArrayStride = sizeof(VkMicromapTriangleKHR)};
    const VkAccelerationStructureGeometryKHR geometry{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                      .pNext = &micromapData,
                                                      .geometryType = VK_GEOMETRY_TYPE_MICROMAP_KHR};
    VkAccelerationStructureBuildGeometryInfoKHR build{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = 1,
        .pGeometries = &geometry};
    // [build end]
    VkAccelerationStructureBuildSizesInfoKHR sizes{.sType =
                                                       VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    context.load<PFN_vkGetAccelerationStructureBuildSizesKHR>("vkGetAccelerationStructureBuildSizesKHR")(
        context.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, nullptr, &sizes);

    const Buffer storage =
        context.createBuffer(sizes.accelerationStructureSize, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    const Buffer scratch = context.createBuffer(sizes.buildScratchSize, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    // [create]
    const VkAccelerationStructureCreateInfo2KHR info{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR,
        .addressRange = {storage.address, sizes.accelerationStructureSize}, // at a multiple of 256 bytes
        .type = build.type};
    // [create end]
    check(context.load<PFN_vkCreateAccelerationStructure2KHR>("vkCreateAccelerationStructure2KHR")(
              context.device(), &info, nullptr, &build.dstAccelerationStructure),
          "vkCreateAccelerationStructure2KHR");
    build.scratchData.deviceAddress = scratch.address;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr; // the usage counts say how much there is to build
    context.submit([&](VkCommandBuffer commands) {
        context.load<PFN_vkCmdBuildAccelerationStructuresKHR>("vkCmdBuildAccelerationStructuresKHR")(commands, 1,
                                                                                                     &build, &ranges);
        const VkMemoryBarrier2 barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                       .srcStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                       .srcAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                       .dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                       .dstAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR};
        const VkDependencyInfo dependency{
            .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO, .memoryBarrierCount = 1, .pMemoryBarriers = &barrier};
        vkCmdPipelineBarrier2(commands, &dependency);
    });
    context.onDestroy([device = context.device(), micromap = build.dstAccelerationStructure,
                       destroy = context.load<PFN_vkDestroyAccelerationStructureKHR>(
                           "vkDestroyAccelerationStructureKHR")] { destroy(device, micromap, nullptr); });
    return build.dstAccelerationStructure;
}

VkDeviceAddress buildBottomLevel(Context &context, const vellum::Micromap &baked, VkAccelerationStructureKHR micromap)
{
    const Buffer indices = context.upload(baked.geometry(0).indices, // of the first input of the bake
                                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    const VkAccelerationStructureTrianglesOpacityMicromapKHR opacity{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR,
        .indexType = VK_INDEX_TYPE_UINT32,
        .indexBuffer = indices.address,
        .indexStride = sizeof(int32_t),
        .micromap = micromap};
    return context.buildCard(&opacity);
}

} // namespace

int main(int argc, char **)
try {
    // [device]
    VkPhysicalDeviceOpacityMicromapFeaturesKHR micromaps{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR, .micromap = VK_TRUE};
    VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR addressCommands{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR,
        .pNext = &micromaps,
        .deviceAddressCommands = VK_TRUE};
    Context context({VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME},
                    &addressCommands);
    // [device end]

    VkPhysicalDeviceOpacityMicromapPropertiesKHR limits{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR};
    VkPhysicalDeviceProperties2 properties{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &limits};
    vkGetPhysicalDeviceProperties2(context.physicalDevice(), &properties);

    const std::vector<float> alpha = paintLeaf(argc > 1);
    const vellum::Micromap baked = bakeLeaf(alpha, limits.maxOpacity4StateSubdivisionLevel);
    const VkAccelerationStructureKHR micromap = buildMicromap(context, baked);
    return traceAndReport(context, buildBottomLevel(context, baked, micromap), alpha,
                          VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
} catch (const std::exception &error) {
    std::cerr << error.what() << "\n";
    return EXIT_FAILURE;
}
