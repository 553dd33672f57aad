// SPDX-License-Identifier: Apache-2.0
// An opacity micromap baked by libvellum, built by VK_EXT_opacity_micromap, attached to a bottom level and traced.
// usage: opacity_micromap_ext [opaque]    opaque: of a card that is opaque all over, which needs no micromap
#include <cstdlib>
#include <exception>
#include <iostream>

#include "context.h"
#include "leaf.h"
#include "report.h"

namespace
{

// Builds a micromap from the result of a bake, if it needs one. It must live as long as the bottom levels that refer to
// it.
VkMicromapEXT buildMicromap(Context &context, const vellum::Micromap &baked)
{
    if (baked.triangles().empty())
        return VK_NULL_HANDLE; // every index is special

    constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    const Buffer data = context.upload(baked.data(), kInput);           // at a multiple of 256 bytes
    const Buffer triangles = context.upload(baked.triangles(), kInput); // at a multiple of 256 bytes
    std::vector<VkMicromapUsageEXT> usages;
    for (const vellum::MicromapUsage &usage : baked.usages())
        usages.push_back({usage.count, usage.subdivisionLevel, usage.format});

    // [build]
    VkMicromapBuildInfoEXT build{.sType = VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT,
                                 .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT,
                                 .flags = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT,
                                 .mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT,
                                 .usageCountsCount = static_cast<uint32_t>(usages.size()),
                                 .pUsageCounts = usages.data(),
                                 .data = {.deviceAddress = data.address},
                                 .triangleArray = {.deviceAddress = triangles.address},
                                 .triangleArrayStride = sizeof(VkMicromapTriangleEXT)};
    VkMicromapBuildSizesInfoEXT sizes{.sType = VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
    context.load<PFN_vkGetMicromapBuildSizesEXT>("vkGetMicromapBuildSizesEXT")(
        context.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, &sizes);

    const Buffer storage = context.createBuffer(sizes.micromapSize, VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    const Buffer scratch = context.createBuffer(sizes.buildScratchSize, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const VkMicromapCreateInfoEXT info{.sType = VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT,
                                       .buffer = storage.buffer, // at an offset that is a multiple of 256
                                       .size = sizes.micromapSize,
                                       .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT};
    check(context.load<PFN_vkCreateMicromapEXT>("vkCreateMicromapEXT")(context.device(), &info, nullptr,
                                                                       &build.dstMicromap),
          "vkCreateMicromapEXT");
    build.scratchData.deviceAddress = scratch.address;
    context.submit([&](VkCommandBuffer commands) {
        context.load<PFN_vkCmdBuildMicromapsEXT>("vkCmdBuildMicromapsEXT")(commands, 1, &build);
        const VkMemoryBarrier2 barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                       .srcStageMask = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT,
                                       .srcAccessMask = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT,
                                       .dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                       .dstAccessMask = VK_ACCESS_2_MICROMAP_READ_BIT_EXT};
        const VkDependencyInfo dependency{
            .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO, .memoryBarrierCount = 1, .pMemoryBarriers = &barrier};
        vkCmdPipelineBarrier2(commands, &dependency);
    });
    // [build end]
    context.onDestroy([device = context.device(), micromap = build.dstMicromap,
                       destroy = context.load<PFN_vkDestroyMicromapEXT>("vkDestroyMicromapEXT")] {
        destroy(device, micromap, nullptr);
    });
    return build.dstMicromap;
}

VkDeviceAddress buildBottomLevel(Context &context, const vellum::Micromap &baked, VkMicromapEXT micromap)
{
    // [attach]
    const vellum::Geometry geometry = baked.geometry(0); // of the first input of the bake
    const Buffer indices =
        context.upload(geometry.indices, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    std::vector<VkMicromapUsageEXT> usages;
    for (const vellum::MicromapUsage &usage : geometry.usages)
        usages.push_back({usage.count, usage.subdivisionLevel, usage.format});
    const VkAccelerationStructureTrianglesOpacityMicromapEXT opacity{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT,
        .indexType = VK_INDEX_TYPE_UINT32,
        .indexBuffer = {.deviceAddress = indices.address},
        .indexStride = sizeof(int32_t),
        .usageCountsCount = static_cast<uint32_t>(usages.size()),
        .pUsageCounts = usages.data(),
        .micromap = micromap};
    // [attach end]
    return context.buildCard(&opacity);
}

} // namespace

int main(int argc, char **)
try {
    // [device]
    VkPhysicalDeviceOpacityMicromapFeaturesEXT features{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT, .micromap = VK_TRUE};
    Context context({VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME}, &features);
    // [device end]

    VkPhysicalDeviceOpacityMicromapPropertiesEXT limits{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT};
    VkPhysicalDeviceProperties2 properties{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &limits};
    vkGetPhysicalDeviceProperties2(context.physicalDevice(), &properties);

    const std::vector<float> alpha = paintLeaf(argc > 1);
    const vellum::Micromap baked = bakeLeaf(alpha, limits.maxOpacity4StateSubdivisionLevel);
    const VkMicromapEXT micromap = buildMicromap(context, baked);
    return traceAndReport(context, buildBottomLevel(context, baked, micromap), alpha,
                          VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
} catch (const std::exception &error) {
    std::cerr << error.what() << "\n";
    return EXIT_FAILURE;
}
