// SPDX-License-Identifier: Apache-2.0
// Wrong builds of micromaps.
#include "recorded.h"

namespace vt
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;

constexpr VkMicromapUsageEXT kTooDeepTwoState{1, 31, kTwoState};
constexpr VkMicromapUsageEXT kTooDeepFourState{1, 31, kFourState};
constexpr VkMicromapUsageEXT kNoFormat{1, 2, 7};
constexpr VkMicromapUsageEXT kGood{1, 2, kFourState};
constexpr const VkMicromapUsageEXT *kGoodPointer = &kGood;
constexpr VkDeviceSize kFar = VkDeviceSize{1} << 20;

// --- VK_EXT_opacity_micromap ---

// Builds a micromap; the wrong build has been changed.
template <auto change>
void extBuild(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    if (wrong)
        change(gpu, info);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 1, &info); });
}

// A query of sizes; the build that it is about has been changed.
template <auto change>
void extSizes(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    if (wrong)
        change(gpu, info);
    auto sizes = vkInit<VkMicromapBuildSizesInfoEXT>();
    gpu.vk().GetMicromapBuildSizesEXT(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &sizes);
}

// An input or scratch memory in a buffer without the usage that it needs.
template <auto member, VkBufferUsageFlags right>
void extUsage(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const Buffer buffer(gpu, 65536,
                        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                            (wrong ? VkBufferUsageFlags{VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT} : right));
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    (info.*member).deviceAddress = (buffer.address() + 255) / 256 * 256;
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 1, &info); });
}

// One build, whose scratch memory begins inside the memory that it builds.
template <bool isMicromap>
void scratchInTarget(Gpu &gpu, bool wrong)
{
    const Buffer both(gpu, 262144,
                      micromapStorageUsage(gpu) | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                          VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress scratch = (both.address() + 255) / 256 * 256 + (wrong ? 256 : 131072);
    if constexpr (isMicromap) {
        MicromapInput input;
        input.add(6, kFourState, std::vector<uint8_t>(4096, 1)); // more than 256 bytes
        const Micromap like(gpu, std::move(input));
        const MicromapHandle target = createMicromap(gpu, both.handle(), both.address(), 0, like.size());
        VkMicromapBuildInfoEXT info = like.buildInfo();
        info.scratchData.deviceAddress = scratch;
        recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, target}});
        });
        destroyMicromap(gpu, target);
    } else {
        Blas blas(gpu);
        blas.placeIn(both.handle(), 0);
        blas.prepare({Geometry{.vertices = triangleRow(16)}});
        VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
        info.scratchData.deviceAddress = scratch;
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
        recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
            gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    }
}

// Two builds by one command: the memory that the second one shares with the first.
enum class Shared { Targets, Scratches, TargetAndScratch };
template <Shared shared>
void extOverlap(Gpu &gpu, bool wrong)
{
    const Micromap one(gpu, oneTriangle()), other(gpu, oneTriangle());
    SharedMemory memory(gpu);
    MicromapBuild builds[] = {{one.buildInfo(), one.handle()}, {other.buildInfo(), other.handle()}};
    if (shared == Shared::Targets) {
        builds[0].target = memory.create(0, one.size());
        builds[1].target = memory.create(wrong ? 0 : 4096, one.size());
    }
    if (shared == Shared::Scratches && wrong)
        builds[1].info.scratchData = builds[0].info.scratchData;
    const Buffer both(gpu, 65536,
                      micromapStorageUsage(gpu) | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                          VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const MicromapHandle inBoth = createMicromap(gpu, both.handle(), both.address(), 0, one.size());
    if (shared == Shared::TargetAndScratch) {
        builds[0].target = inBoth;
        builds[0].info.scratchData.deviceAddress = (both.address() + 255) / 256 * 256 + (wrong ? 0 : 16384);
    }
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu, commands, builds); });
    destroyMicromap(gpu, inBoth);
}

// --- VK_KHR_opacity_micromap ---

template <auto change>
void khrBuild(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    if (wrong)
        change(gpu, build);
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &ranges);
    });
}

void khrRanges(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    const VkAccelerationStructureBuildRangeInfoKHR range{.primitiveCount = 1};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = wrong ? &range : nullptr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &ranges);
    });
}

void khrUsage(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    const Buffer buffer(gpu, 4096,
                        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                            (wrong ? VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT
                                   : VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR));
    build.data.data = (buffer.address() + 127) / 128 * 128;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &ranges);
    });
}

void khrIndirect(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Buffer ranges(gpu, 64, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress address = ranges.address();
    const uint32_t stride = sizeof(VkAccelerationStructureBuildRangeInfoKHR), one = 1;
    const uint32_t *most = &one;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, wrong ? &build.info : &blas.buildInfo(),
                                                           &address, &stride, &most);
    });
}

template <auto change>
void khrSizes(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    auto type = VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR;
    const uint32_t one = 1;
    const uint32_t *most = nullptr;
    if (wrong)
        change(build, type, most, &one);
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    gpu.vk().GetAccelerationStructureBuildSizesKHR(gpu.device(), type, &build.info, most, &sizes);
}

constexpr auto kLossyBit = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

// A build of a structure of triangles with flags.
template <VkBuildAccelerationStructureFlagsKHR right, VkBuildAccelerationStructureFlagsKHR wrongFlags>
void structureFlags(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    BuildInfo info = blas.buildInfo();
    info.flags = wrong ? wrongFlags : right;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

void geometryOfMicromap(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    BuildInfo info = blas.buildInfo();
    if (wrong)
        info.pGeometries = &build.geometry;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

void targetOfOtherType(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    SharedMemory memory(gpu);
    const MicromapHandle target = memory.create(0, 32768,
                                                wrong ? VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR
                                                      : VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    const MicromapBuild build{micromap.buildInfo(), target};
    recordUnlessWrong(gpu, wrong,
                      [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu, commands, std::span(&build, 1)); });
}

// Scratch memory at the end of a buffer, or with what the build needs.
void scratchPastTheBuffer(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const Buffer buffer(gpu, 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    MicromapBuild build{micromap.buildInfo(), micromap.handle()};
    build.info.scratchData.deviceAddress = (buffer.address() + (wrong ? 65535 : 255)) / 256 * 256;
    recordUnlessWrong(gpu, wrong,
                      [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu, commands, std::span(&build, 1)); });
}

// The scratch memory of a structure of triangles begins at most 16 bytes before the end of its buffer.
template <bool update>
void structureScratchPastTheBuffer(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(500)}},
                    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR);
    BuildInfo info = blas.buildInfo();
    if (update) {
        info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        info.srcAccelerationStructure = info.dstAccelerationStructure;
    }
    constexpr VkDeviceSize kMuch = 1 << 20; // a multiple of alignments
    const Buffer buffer(gpu, kMuch + 16,
                        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    info.scratchData.deviceAddress = (buffer.address() + (wrong ? kMuch : 255)) / 256 * 256;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

// A build of a structure of triangles that has been changed.
template <auto change>
void structureBuild(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    BuildInfo info = blas.buildInfo();
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    if (wrong)
        change(info, ranges);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

// As above, by an indirect command.
template <auto change>
void indirectBuild(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    Build build(gpu, blas, By::Indirect);
    if (wrong)
        change(build.info);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

// Two structures that one indirect command builds: what of them is in the same memory.
enum class Same { Structure, Targets, Scratches, TargetAndScratch };
template <Same same>
void indirectOverlap(Gpu &gpu, bool wrong)
{
    const std::vector<Geometry> geometries{Geometry{.vertices = triangleRow(16)}};
    const Buffer memory(gpu, 524288,
                        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Blas one(gpu), other(gpu);
    one.placeIn(memory.handle(), 0);
    other.placeIn(memory.handle(), wrong && same == Same::Targets ? 0 : 131072);
    one.prepare(geometries);
    other.prepare(geometries);
    std::array infos{one.buildInfo(), other.buildInfo()};
    const VkDeviceAddress first = (memory.address() + 255) / 256 * 256;
    if (same == Same::Structure && wrong)
        infos[1].dstAccelerationStructure = infos[0].dstAccelerationStructure;
    if (same == Same::Scratches)
        infos[1].scratchData.deviceAddress = wrong ? infos[0].scratchData.deviceAddress : first + 262144;
    if (same == Same::TargetAndScratch)
        infos[1].scratchData.deviceAddress = first + (wrong ? 0 : 262144);
    const Build ranges(gpu, one, By::Indirect);
    const VkDeviceAddress addresses[] = {ranges.memory.address(), ranges.memory.address()};
    const uint32_t strides[] = {sizeof *ranges.ranges, sizeof *ranges.ranges}, most = 16;
    const uint32_t *counts[] = {&most, &most};
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 2, infos.data(), addresses, strides, counts);
    });
}

template <By by>
void updateOfMicromap(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR);
    Build build(gpu, blas, by);
    build.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    build.info.srcAccelerationStructure = wrong ? micromap.handle().khr : build.info.dstAccelerationStructure;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

// The buffer of the structure that is built was destroyed.
void indirectIntoNoBuffer(Gpu &gpu, bool wrong)
{
    const std::vector<Geometry> geometries{Geometry{.vertices = triangleRow(1)}};
    Storage storage(gpu);
    Blas blas(gpu);
    blas.placeIn(storage.buffer(), 0);
    blas.prepare(geometries);
    const Build build(gpu, blas, By::Indirect);
    if (wrong)
        storage.destroyBuffer();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

void bothArrays(BuildInfo &info, const VkAccelerationStructureBuildRangeInfoKHR *&)
{
    static const VkAccelerationStructureGeometryKHR *geometry;
    geometry = info.pGeometries;
    info.ppGeometries = &geometry;
}

void noInstances(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    Tlas tlas(gpu);
    tlas.prepare(std::array{instance(blas, {}, 0)});
    BuildInfo info = tlas.buildInfo();
    info.geometryCount = wrong ? 0 : 1;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = tlas.ranges();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

// Without the feature there is no valid program.
void sizesWithoutFeature(Gpu &gpu, bool wrong)
{
    if (!wrong)
        return;
    auto info = vkInit<VkMicromapBuildInfoEXT>({.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    micromapSizes(gpu, info);
}

void sameTarget(Gpu &gpu, bool wrong)
{
    const Micromap one(gpu, oneTriangle()), other(gpu, oneTriangle());
    const MicromapBuild builds[] = {{one.buildInfo(), one.handle()},
                                    {other.buildInfo(), wrong ? one.handle() : other.handle()}};
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu, commands, builds); });
}

void tooSmall(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    SharedMemory memory(gpu);
    const MicromapBuild build{micromap.buildInfo(), memory.create(0, wrong ? 16 : micromap.size())};
    recordUnlessWrong(gpu, wrong,
                      [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu, commands, std::span(&build, 1)); });
}

#define EXT_CHANGE(...) [](Gpu &, VkMicromapBuildInfoEXT &info) { __VA_ARGS__; }
#define KHR_CHANGE(...) [](Gpu &, StructureBuild &build) { __VA_ARGS__; }

const WrongProgram kPrograms[] = {
    {"VUID-vkCmdBuildMicromapsEXT-mode-07462", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.mode = static_cast<VkBuildMicromapModeEXT>(3))>},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.dstMicromap = VK_NULL_HANDLE)>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07461", Api::Ext, kNeedsNothing, tooSmall},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07512", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.scratchData.deviceAddress = 0)>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07514", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.scratchData.deviceAddress += 1)>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07509", Api::Ext, kNeedsNothing, scratchPastTheBuffer},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07515", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.data.deviceAddress -= 128)>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07515", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.triangleArray.deviceAddress -= 128)>, "Triangles"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10896", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.data.deviceAddress = 0)>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10897", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.triangleArray.deviceAddress = 0)>},
    {"VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.ppUsageCounts = &kGoodPointer)>},
    {"VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.pUsageCounts = nullptr)>, "Neither"},
    {"VUID-VkMicromapBuildInfoEXT-format-11652", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.pUsageCounts = &kNoFormat)>},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.pUsageCounts = &kTooDeepTwoState)>},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655", Api::Ext, kNeedsNothing,
     extBuild<EXT_CHANGE(info.pUsageCounts = &kTooDeepFourState)>},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655", Api::Ext, kNeedsNothing,
     extSizes<EXT_CHANGE(info.pUsageCounts = &kTooDeepFourState)>, "Sizes"},
    {"VUID-vkCmdBuildMicromapsEXT-data-07510", Api::Ext, kNeedsNothing,
     extUsage<&VkMicromapBuildInfoEXT::data, VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07511", Api::Ext, kNeedsNothing,
     extUsage<&VkMicromapBuildInfoEXT::scratchData, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT>},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-11649", Api::Ext, kNeedsNothing, extOverlap<Shared::Targets>},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-11649", Api::Ext, kNeedsNothing, sameTarget, "Same"},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-11650", Api::Ext, kNeedsNothing, extOverlap<Shared::TargetAndScratch>},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-11650", Api::Ext, kNeedsNothing, scratchInTarget<true>, "Own"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703", Api::Khr, kNeedsNothing,
     scratchInTarget<true>, "Own"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703", Api::Ext, kNeedsNothing,
     scratchInTarget<false>, "OwnBottom"},
    {"VUID-vkCmdBuildMicromapsEXT-scratchData-11651", Api::Ext, kNeedsNothing, extOverlap<Shared::Scratches>},

    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.geometryCount = 2)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788", Api::Khr, kNeedsNothing,
     structureBuild<bothArrays>, "OfStructure"},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(static const VkAccelerationStructureGeometryKHR *geometry; geometry = &build.geometry;
                         build.info.ppGeometries = &geometry)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR)>},
    {"VUID-VkAccelerationStructureGeometryKHR-flags-11569", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR)>},
    {"VUID-VkAccelerationStructureGeometryKHR-micromap-11568", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.geometry.pNext = nullptr)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.flags = VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-11546", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.srcAccelerationStructure = build.info.dstAccelerationStructure)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11544", Api::Khr, kNeedsNothing, khrRanges},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547", Api::Khr, kNeedsNothing,
     targetOfOtherType},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.data = 0)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.triangleArray = 0)>, "Triangles"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11551", Api::Khr, kNeedsNothing, khrUsage},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.data -= 64)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.triangleArrayStride = kFar)>},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.triangleArrayStride = 4)>},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.triangleArrayStride = 10; build.data.triangleArray -= 128)>},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.data.ppUsageCounts = build.usagePointers.data())>},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643", Api::Khr, kNeedsNothing,
     khrSizes<[](StructureBuild &build, auto &, auto &, auto) { build.usages[0].count = 1u << 28; }>},
    {"VUID-VkMicromapUsageKHR-format-parameter", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.usages[0].format = static_cast<VkOpacityMicromapFormatKHR>(7))>},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.usages[0] = {1, 31, VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR})>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.usages[0].subdivisionLevel = 31)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.flags = kLossyBit; build.usages[0].subdivisionLevel = 31)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.flags = kLossyBit;
                         build.usages[0].format = VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126", Api::Khr, kNeedsNothing, tooSmall},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.scratchData.deviceAddress = 0)>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559", Api::Khr, kNeedsNoFeature, sizesWithoutFeature},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258", Api::Khr, kNeedsNothing, scratchPastTheBuffer},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258", Api::Khr, kNeedsNothing,
     structureScratchPastTheBuffer<false>, "Bottom"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12259", Api::Khr, kNeedsNothing,
     structureScratchPastTheBuffer<true>, "Bottom"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543", Api::Khr, kNeedsNothing,
     structureBuild<[](BuildInfo &, auto &ranges) { ranges = nullptr; }>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-mode-04628", Api::Khr, kNeedsNothing,
     structureBuild<[](BuildInfo &info, auto &) { info.mode = static_cast<VkBuildAccelerationStructureModeKHR>(7); }>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630", Api::Khr, kNeedsNothing,
     structureBuild<[](BuildInfo &info, auto &) { info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR; }>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629", Api::Khr, kNeedsNothing,
     updateOfMicromap<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-srcAccelerationStructure-04629", Api::Khr, kNeedsNothing,
     updateOfMicromap<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-mode-04628", Api::Khr, kNeedsNothing,
     indirectBuild<[](BuildInfo &info) { info.mode = static_cast<VkBuildAccelerationStructureModeKHR>(7); }>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-04630", Api::Khr, kNeedsNothing,
     indirectBuild<[](BuildInfo &info) { info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR; }>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03707", Api::Khr, kNeedsNothing, indirectIntoNoBuffer},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03698", Api::Khr, kNeedsNothing,
     indirectOverlap<Same::Structure>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03702", Api::Khr, kNeedsNothing,
     indirectOverlap<Same::Targets>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03703", Api::Khr, kNeedsNothing,
     indirectOverlap<Same::TargetAndScratch>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-scratchData-03704", Api::Khr, kNeedsNothing,
     indirectOverlap<Same::Scratches>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03790", Api::Khr, kNeedsNothing, noInstances},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710", Api::Khr, kNeedsNothing,
     khrBuild<KHR_CHANGE(build.info.scratchData.deviceAddress += 1)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03698", Api::Khr, kNeedsNothing, sameTarget},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03702", Api::Khr, kNeedsNothing,
     extOverlap<Shared::Targets>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703", Api::Khr, kNeedsNothing,
     extOverlap<Shared::TargetAndScratch>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-scratchData-03704", Api::Khr, kNeedsNothing,
     extOverlap<Shared::Scratches>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557", Api::Khr, kNeedsNothing, khrIndirect},
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-buildType-11614", Api::Khr, kNeedsNothing,
     khrSizes<[](StructureBuild &, auto &type, auto &, auto) {
         type = VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR;
     }>},
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11613", Api::Khr, kNeedsNothing,
     khrSizes<[](StructureBuild &, auto &, auto &most, auto one) { most = one; }>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-11563", Api::Khr, kNeedsNothing,
     structureFlags<VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR, kLossyBit>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-03796", Api::Khr, kNeedsNothing,
     structureFlags<VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
                    VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                        VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11558", Api::Ext, kNeedsNothing,
     structureFlags<VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR,
                    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR |
                        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11709", Api::Khr, kNeedsNothing,
     structureFlags<0, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11710", Api::Khr, kNeedsNoFeature,
     structureFlags<0, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11711", Api::Khr, kNeedsNoFeature,
     structureFlags<0, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR>},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707", Api::Khr, kNeedsNothing,
     geometryOfMicromap},
};

#undef EXT_CHANGE
#undef KHR_CHANGE

} // namespace

std::span<const WrongProgram> buildPrograms()
{
    return kPrograms;
}

} // namespace vt
