// SPDX-License-Identifier: Apache-2.0
// Wrong data on the GPU.
#include "programs.h"

namespace vt
{
namespace
{

// Two triangles of level 2.
MicromapInput twoTriangles(uint16_t format = kFourState)
{
    MicromapInput input;
    for (int i = 0; i < 2; ++i)
        input.add(2, format, std::vector<uint8_t>(16, 1));
    input.declared = input.usage();
    return input;
}

void build(Gpu &gpu, MicromapInput input, VkBuildMicromapFlagsEXT flags = 0)
{
    Micromap micromap(gpu, std::move(input), flags);
    micromap.build();
}

void wrongFormat(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    input.triangles[1].format = wrong ? 3 : kFourState;
    build(gpu, std::move(input));
}

void wrongLevel(Gpu &gpu, bool wrong, uint16_t format, VkBuildMicromapFlagsEXT flags = 0)
{
    MicromapInput input = twoTriangles(format);
    input.triangles[1].subdivisionLevel = wrong ? 13 : 2;
    build(gpu, std::move(input), flags);
}

void twoStateLevel(Gpu &gpu, bool wrong)
{
    wrongLevel(gpu, wrong, kTwoState);
}

void fourStateLevel(Gpu &gpu, bool wrong)
{
    wrongLevel(gpu, wrong, kFourState);
}

void lossyLevel(Gpu &gpu, bool wrong)
{
    wrongLevel(gpu, wrong, kFourState, kLossy);
}

void lossyFormat(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    input.triangles[1].format = wrong ? kTwoState : kFourState;
    build(gpu, std::move(input), kLossy);
}

void dataOffset(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    if (wrong)
        input.triangles[1].dataOffset = 0xfffffff0;
    build(gpu, std::move(input));
}

void usageCounts(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    if (wrong)
        input.triangles[1].subdivisionLevel = 1;
    build(gpu, std::move(input));
}

void undeclaredLevel(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    if (wrong)
        input.triangles[1].subdivisionLevel = 3;
    build(gpu, std::move(input));
}

void triangleArray(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    if (wrong)
        info.triangleArrayStride = VkDeviceSize{1} << 31;
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
}

// The geometry of two triangles with that attachment.
void attach(Gpu &gpu, Attachment attachment)
{
    Geometry geometry{.vertices = triangleRow(2)};
    geometry.micromap = std::move(attachment);
    const Blas blas(gpu, {geometry});
}

void wrongIndex(Gpu &gpu, bool wrong, VkIndexType type)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    attach(gpu, {&micromap, type, {-1, wrong ? 2 : 1}});
}

void index16(Gpu &gpu, bool wrong)
{
    wrongIndex(gpu, wrong, VK_INDEX_TYPE_UINT16);
}

void index32(Gpu &gpu, bool wrong)
{
    wrongIndex(gpu, wrong, VK_INDEX_TYPE_UINT32);
}

void baseTriangle(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    Attachment attachment{&micromap, VK_INDEX_TYPE_UINT16, {-4, 0}};
    attachment.base = wrong ? 0xffffffff : 1;
    attach(gpu, std::move(attachment));
}

MicromapInput oneOfTwoTriangles()
{
    MicromapInput one = twoTriangles();
    one.triangles.pop_back();
    one.declared[0].count = 1;
    return one;
}

// A build by the same handle with fewer triangles.
void indexAfterRebuild(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    if (wrong) {
        if (!micromap.setInput(oneOfTwoTriangles()))
            throw std::runtime_error("a smaller micromap needs more memory");
        micromap.build();
    }
    attach(gpu, {&micromap, VK_INDEX_TYPE_UINT32, {0, 1}});
}

// A copy of a micromap with fewer triangles.
void indexAfterCopy(Gpu &gpu, bool wrong)
{
    Micromap target(gpu, twoTriangles());
    target.build();
    Micromap source(gpu, wrong ? oneOfTwoTriangles() : twoTriangles());
    source.build();
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, source.handle(), target.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
    attach(gpu, {&target, VK_INDEX_TYPE_UINT32, {0, 1}});
}

// A micromap of one triangle, or of two, is deserialized.
void indexAfterDeserialization(Gpu &gpu, bool wrong)
{
    Micromap target(gpu, twoTriangles());
    target.build();
    Micromap source(gpu, wrong ? oneOfTwoTriangles() : twoTriangles());
    source.build();
    const Buffer memory(gpu, 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const VkDeviceAddress data = (memory.address() + 255) / 256 * 256;
    gpu.submit([&](VkCommandBuffer commands) { recordMicromapToMemory(gpu, commands, source.handle(), data); });
    gpu.submit([&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu, commands, data, target.handle()); });
    attach(gpu, {&target, VK_INDEX_TYPE_UINT32, {0, 1}});
}

void indexAfterHostBuild(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, twoTriangles());
    micromap.buildOnHost();
    attach(gpu, {&micromap, VK_INDEX_TYPE_UINT32, {0, wrong ? 2 : 1}});
}

void formatOnHost(Gpu &gpu, bool wrong)
{
    MicromapInput input = twoTriangles();
    input.triangles[1].format = wrong ? 3 : kFourState;
    const Micromap micromap(gpu, std::move(input));
    micromap.buildOnHost();
}

void numbers(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    attach(gpu, {.micromap = &micromap, .base = wrong ? 1u : 0u});
}

void numbersKhr(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{.micromap = &micromap, .base = wrong ? 3u : 0u};
    const Blas blas(gpu, {geometry});
}

void notSpecial(Gpu &gpu, bool wrong)
{
    attach(gpu, {nullptr, VK_INDEX_TYPE_UINT32, {-1, wrong ? 0 : -4}});
}

void indexBuffer(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    Attachment attachment{&micromap, VK_INDEX_TYPE_UINT32, {0, 1}};
    if (wrong) {
        attachment.indices.pop_back();
        attachment.stride = 1u << 30;
    }
    attach(gpu, std::move(attachment));
}

constexpr VkBuildAccelerationStructureFlagsKHR kAllowDisable =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR;

void disable(Gpu &gpu, bool wrong, Arrangement arrangement, bool indirect = false)
{
    Micromap micromap(gpu, twoTriangles());
    micromap.build();
    Geometry geometry{.vertices = triangleRow(2)};
    geometry.micromap = Attachment{.micromap = &micromap};
    const Blas allowed(gpu, {geometry}, kAllowDisable);
    const Blas other(gpu, {geometry}, wrong ? 0 : kAllowDisable);
    const std::vector instances{instance(allowed, {}, 0, kFlagDisable), instance(other, {}, 1, kFlagDisable)};
    Tlas tlas(gpu);
    tlas.prepare(instances, 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, arrangement);
    const StructureBuilds builds(gpu, std::array<const Structure *, 1>{&tlas}, indirect);
    gpu.submit([&](VkCommandBuffer commands) { builds.record(commands); });
}

void disableInArray(Gpu &gpu, bool wrong)
{
    disable(gpu, wrong, Arrangement::Array);
}

void disableByPointers(Gpu &gpu, bool wrong)
{
    disable(gpu, wrong, Arrangement::Pointers);
}

void flagsWithoutFeature(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Tlas tlas(gpu, {instance(blas, {}, 0, wrong ? kFlagTwoState : 0)});
}

constexpr WrongProgram kPrograms[] = {
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11555", Api::Khr, kNeedsNothing, wrongFormat},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11556", Api::Khr, kNeedsNothing, twoStateLevel},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11566", Api::Khr, kNeedsNothing,
     fourStateLevel},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11567", Api::Khr, kNeedsNothing, lossyLevel},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11713", Api::Khr, kNeedsNothing, lossyFormat},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11553", Api::Khr, kNeedsNothing, dataOffset},
    {"VUID-VkMicromapBuildInfoEXT-format-11657", Api::Ext, kNeedsNothing, wrongFormat},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11659", Api::Ext, kNeedsNothing, twoStateLevel},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11660", Api::Ext, kNeedsNothing, fourStateLevel},
    {"micromap-data", Api::Ext, kNeedsNothing, dataOffset},
    {"micromap-triangle-array", Api::Ext, kNeedsNothing, triangleArray},
    {"micromap-usage-counts", Api::Khr, kNeedsNothing, usageCounts, "Khr"},
    {"micromap-usage-counts", Api::Ext, kNeedsNothing, usageCounts, "Ext"},
    {"micromap-usage-counts", Api::Khr, kNeedsNothing, undeclaredLevel, "Undeclared"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsNothing, index16, "16"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsNothing, index32, "32"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsNothing, baseTriangle, "Base"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsNothing, indexAfterRebuild,
     "Rebuilt"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsNothing, indexAfterCopy, "Copied"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575", Api::Khr, kNeedsEmulation, indexAfterDeserialization,
     "Deserialized"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577", Api::Khr, kNeedsNothing, indexBuffer},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11578", Api::Khr, kNeedsNothing, notSpecial},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-geometry-11576", Api::Khr, kNeedsNothing, numbersKhr},
    {"micromap-index", Api::Ext, kNeedsNothing, index32},
    {"micromap-index", Api::Ext, kNeedsNothing, notSpecial, "NotSpecial"},
    {"micromap-index", Api::Ext, kNeedsNothing, numbers, "Numbers"},
    {"micromap-index", Api::Ext, kNeedsNothing, indexBuffer, "Buffer"},
    {"micromap-index", Api::Ext, kNeedsHostCommands, indexAfterHostBuild, "HostBuild"},
    {"VUID-VkMicromapBuildInfoEXT-format-11657", Api::Ext, kNeedsHostCommands, formatOnHost, "Host"},
    {"VUID-VkAccelerationStructureInstanceKHR-flags-11581", Api::Khr, kNeedsNothing, disableInArray, "Array"},
    {"VUID-VkAccelerationStructureInstanceKHR-flags-11581", Api::Khr, kNeedsNothing, disableByPointers, "Pointers"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10607", Api::Ext, kNeedsNothing, disableInArray},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10607", Api::Ext, kNeedsNothing,
     [](Gpu &gpu, bool wrong) { disable(gpu, wrong, Arrangement::Array, true); }},
    {"VUID-VkAccelerationStructureInstanceKHR-micromap-11580", Api::Khr, kNeedsNoFeature, flagsWithoutFeature},
};

} // namespace

std::span<const WrongProgram> dataPrograms()
{
    return kPrograms;
}

} // namespace vt
