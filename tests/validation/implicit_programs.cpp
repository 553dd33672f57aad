// SPDX-License-Identifier: Apache-2.0
// Wrong uses that the registry forbids for all commands and structures ("Valid Usage (Implicit)").
#include "recorded.h"

namespace vt
{
namespace
{

constexpr auto kClone = VK_COPY_MICROMAP_MODE_CLONE_EXT;

// Records a copy of a micromap, around which `before` and `after` record other commands; executes nothing.
template <auto before, auto after>
void record(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        before(commands, wrong);
        recordMicromapCopy(gpu, commands, twins.built, target.handle(), kClone);
        after(commands, wrong);
    });
}

void beginRendering(VkCommandBuffer commands, VkRenderingFlags flags)
{
    const auto info = vkInit<VkRenderingInfo>({.flags = flags, .renderArea = {{0, 0}, {1, 1}}, .layerCount = 1});
    vkCmdBeginRendering(commands, &info);
}

void beginIfWrong(VkCommandBuffer commands, bool wrong)
{
    beginRendering(commands, 0);
    if (!wrong)
        vkCmdEndRendering(commands);
}
void endIfWrong(VkCommandBuffer commands, bool wrong)
{
    if (wrong)
        vkCmdEndRendering(commands);
}

void suspendIfWrong(VkCommandBuffer commands, bool wrong)
{
    beginRendering(commands, wrong ? VkRenderingFlags{VK_RENDERING_SUSPENDING_BIT} : 0);
    vkCmdEndRendering(commands);
}
void resumeIfWrong(VkCommandBuffer commands, bool wrong)
{
    if (!wrong)
        return;
    beginRendering(commands, VK_RENDERING_RESUMING_BIT);
    vkCmdEndRendering(commands);
}

void ended(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    const VkCommandBuffer commands = gpu.begin();
    if (wrong)
        gpu.end(commands);
    recordMicromapCopy(gpu, commands, twins.built, target.handle(), kClone);
    if (!wrong)
        gpu.end(commands);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}

// Queue family 3 is for transfers only. No micromaps are built: emulation would dispatch there.
void transferFamily(Gpu &gpu, bool wrong)
{
    const auto info = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = wrong ? 3u : gpu.family()});
    VkCommandPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateCommandPool(gpu.device(), &info, nullptr, &pool));
    const auto allocation = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = pool, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &allocation, &commands));
    const auto begin = vkInit<VkCommandBufferBeginInfo>();
    VT_CHECK(vkBeginCommandBuffer(commands, &begin));
    if (wrong)
        gpu.vk().CmdBuildMicromapsEXT(commands, 0, nullptr);
    VT_CHECK(vkEndCommandBuffer(commands));
    vkDestroyCommandPool(gpu.device(), pool, nullptr);
}

void noBuilds(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const VkMicromapBuildInfoEXT info = micromap.buildInfo();
    recordUnlessWrong(gpu, true,
                      [&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, wrong ? 0 : 1, &info); });
}

template <auto change>
void build(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    if (wrong)
        change(info);
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 1, &info); });
}

template <auto change>
void copy(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    auto info = vkInit<VkCopyMicromapInfoEXT>({.src = twins.built.ext, .dst = target.handle().ext, .mode = kClone});
    if (wrong)
        change(info);
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) { gpu.vk().CmdCopyMicromapEXT(commands, &info); });
}

// A geometry that attaches a null micromap, by two structures.
void attachesTwice(Gpu &gpu, bool wrong)
{
    const std::array<float, 9> places{0, 0, 0, 1, 0, 0, 0, 1, 0};
    const Buffer vertices =
        gpu.upload<float>(places, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    const Buffer indices = gpu.upload<uint32_t>(std::array<uint32_t, 1>{0xffffffff},
                                                VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    const Buffer scratch(gpu, 1 << 20, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Structure target(gpu, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    target.create(65536);
    auto first = vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>(
        {.indexType = VK_INDEX_TYPE_UINT32, .indexBuffer = indices.address(), .indexStride = 4});
    const auto second = first;
    if (wrong)
        first.pNext = const_cast<VkAccelerationStructureTrianglesOpacityMicromapKHR *>(&second);
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
    auto &triangles = geometry.geometry.triangles;
    triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>({.pNext = &first,
                                                                         .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                                                                         .vertexStride = 12,
                                                                         .maxVertex = 2,
                                                                         .indexType = VK_INDEX_TYPE_NONE_KHR});
    triangles.vertexData.deviceAddress = vertices.address();
    auto info =
        vkInit<VkAccelerationStructureBuildGeometryInfoKHR>({.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                                                             .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                                                             .dstAccelerationStructure = target.handle(),
                                                             .geometryCount = 1,
                                                             .pGeometries = &geometry});
    info.scratchData.deviceAddress = (scratch.address() + 255) / 256 * 256;
    const VkAccelerationStructureBuildRangeInfoKHR range{.primitiveCount = 1};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

// A build of a micromap with its data twice.
void dataTwice(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    const auto second = build.data;
    if (wrong)
        build.data.pNext = &second;
    const VkAccelerationStructureBuildRangeInfoKHR *none = nullptr;
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &none);
    });
}

template <auto change>
void sizes(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const VkMicromapBuildInfoEXT info = micromap.buildInfo();
    auto result = vkInit<VkMicromapBuildSizesInfoEXT>({});
    if (wrong)
        change(result);
    gpu.vk().GetMicromapBuildSizesEXT(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &result);
}

template <auto change>
void create(Gpu &gpu, bool wrong)
{
    const Buffer memory(gpu, 65536, micromapStorageUsage(gpu));
    auto info =
        vkInit<VkAccelerationStructureCreateInfo2KHR>({.addressRange = {(memory.address() + 255) / 256 * 256, 4096},
                                                       .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    if (wrong)
        change(info);
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

constexpr VkMemoryBarrier kNothing{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, 0, 0};

const WrongProgram kPrograms[] = {
    {"VUID-vkCmdCopyMicromapEXT-commandBuffer-recording", Api::Ext, kNeedsNothing, ended},
    {"VUID-vkCmdCopyAccelerationStructureKHR-commandBuffer-recording", Api::Khr, kNeedsNothing, ended},
    {"VUID-vkCmdCopyMicromapEXT-renderpass", Api::Ext, kNeedsNothing, record<beginIfWrong, endIfWrong>},
    {"VUID-vkCmdCopyAccelerationStructureKHR-renderpass", Api::Khr, kNeedsNothing, record<beginIfWrong, endIfWrong>},
    {"VUID-vkCmdCopyMicromapEXT-suspended", Api::Ext, kNeedsNothing, record<suspendIfWrong, resumeIfWrong>},
    {"VUID-vkCmdCopyAccelerationStructureKHR-suspended", Api::Khr, kNeedsNothing,
     record<suspendIfWrong, resumeIfWrong>},
    {"VUID-vkCmdBuildMicromapsEXT-commandBuffer-cmdpool", Api::Ext, kNeedsTransferQueue, transferFamily, "",
     "VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength"},
    {"VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength", Api::Ext, kNeedsNothing, noBuilds},
    {"VUID-VkMicromapBuildInfoEXT-sType-sType", Api::Ext, kNeedsNothing,
     build<[](VkMicromapBuildInfoEXT &info) { info.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER; }>},
    {"VUID-VkMicromapBuildInfoEXT-pNext-pNext", Api::Ext, kNeedsNothing,
     build<[](VkMicromapBuildInfoEXT &info) { info.pNext = &kNothing; }>},
    {"VUID-VkMicromapBuildInfoEXT-flags-parameter", Api::Ext, kNeedsNothing,
     build<[](VkMicromapBuildInfoEXT &info) { info.flags = 0x1000; }>, "", "", false, "ext"},
    {"VUID-VkMicromapBuildInfoEXT-type-parameter", Api::Ext, kNeedsNothing,
     build<[](VkMicromapBuildInfoEXT &info) { info.type = static_cast<VkMicromapTypeEXT>(7); }>},
    {"VUID-VkCopyMicromapInfoEXT-sType-sType", Api::Ext, kNeedsNothing,
     copy<[](VkCopyMicromapInfoEXT &info) { info.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER; }>},
    {"VUID-VkCopyMicromapInfoEXT-pNext-pNext", Api::Ext, kNeedsNothing,
     copy<[](VkCopyMicromapInfoEXT &info) { info.pNext = &kNothing; }>},
    {"VUID-VkAccelerationStructureGeometryTrianglesDataKHR-sType-unique", Api::Khr, kNeedsNothing, attachesTwice},
    {"VUID-VkAccelerationStructureGeometryKHR-sType-unique", Api::Khr, kNeedsNothing, dataTwice},
    {"VUID-VkMicromapBuildSizesInfoEXT-sType-sType", Api::Ext, kNeedsNothing,
     sizes<[](VkMicromapBuildSizesInfoEXT &info) { info.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER; }>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-sType-sType", Api::Khr, kNeedsAddressCommands,
     create<[](VkAccelerationStructureCreateInfo2KHR &info) { info.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER; }>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-type-parameter", Api::Khr, kNeedsAddressCommands,
     create<[](VkAccelerationStructureCreateInfo2KHR &info) {
         info.type = static_cast<VkAccelerationStructureTypeKHR>(77);
     }>},
};

} // namespace

std::span<const WrongProgram> implicitPrograms()
{
    return kPrograms;
}

} // namespace vt
