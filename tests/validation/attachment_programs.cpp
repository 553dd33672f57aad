// SPDX-License-Identifier: Apache-2.0
// Wrong micromaps of geometries, and wrong updates.
#include "recorded.h"

namespace vt
{
namespace
{

using Ext = VkAccelerationStructureTrianglesOpacityMicromapEXT;
using Khr = VkAccelerationStructureTrianglesOpacityMicromapKHR;
using Flags = VkBuildAccelerationStructureFlagsKHR;

constexpr VkMicromapUsageEXT kTooDeepTwoState{1, 31, kTwoState};
constexpr VkMicromapUsageEXT kTooDeepFourState{1, 31, kFourState};
constexpr VkMicromapUsageEXT kNoFormat{1, 2, 7};
constexpr VkMicromapUsageEXT kGood{1, 2, kFourState};
constexpr const VkMicromapUsageEXT *kGoodPointer = &kGood;
constexpr Flags kUpdatable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
constexpr Flags kReplaces = kUpdatable | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR;
constexpr Flags kReplacesData = kUpdatable | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
constexpr auto kUpdate = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;

Geometry withMicromap(const Micromap *micromap, std::vector<int32_t> indices = {0})
{
    return {.vertices = triangleRow(1),
            .micromap =
                Attachment{.micromap = micromap, .indexType = VK_INDEX_TYPE_UINT32, .indices = std::move(indices)}};
}

constexpr VkIndexType kNoIndices = VK_INDEX_TYPE_NONE_KHR;
constexpr VkIndexType kUint16 = VK_INDEX_TYPE_UINT16;
constexpr VkIndexType kUint32 = VK_INDEX_TYPE_UINT32;

// Builds a triangle with a micromap; in the wrong build the structure that attaches it has been changed.
template <typename Attached, auto change, By by = By::Host>
void attach(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas blas(gpu, {withMicromap(&micromap)});
    Build build(gpu, blas, by);
    auto attached = *static_cast<const Attached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &attached;
    if (wrong)
        change(attached);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

// Attaches a micromap of VK_KHR_opacity_micromap or VK_EXT_opacity_micromap to `triangles` triangles. The GPU finds
// `inMemory` at its place.
void attachTwin(Gpu &gpu, const Micromap &inMemory, MicromapHandle handle, VkIndexType indexType, uint32_t triangles,
                By by = By::Host)
{
    Geometry geometry{.vertices = triangleRow(triangles),
                      .micromap = Attachment{.micromap = &inMemory, .indexType = indexType}};
    if (indexType != VK_INDEX_TYPE_NONE_KHR)
        geometry.micromap->indices.assign(triangles, 0);
    const Blas blas(gpu, {geometry});
    Build build(gpu, blas, by);
    const void *attached = build.geometry.geometry.triangles.pNext;
    auto ext = gpu.khr() ? vkInit<Ext>() : *static_cast<const Ext *>(attached);
    auto khr = gpu.khr() ? *static_cast<const Khr *>(attached) : vkInit<Khr>();
    ext.micromap = handle.ext;
    khr.micromap = handle.khr;
    build.geometry.geometry.triangles.pNext = gpu.khr() ? static_cast<const void *>(&khr) : &ext;
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

void buildAt(Gpu &gpu, const Micromap &micromap, MicromapHandle handle)
{
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{micromap.buildInfo(), handle}});
    });
}

template <By by>
void notBuilt(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    attachTwin(gpu, micromap, wrong ? twins.other : twins.built, VK_INDEX_TYPE_UINT32, 1, by);
}

// A GENERIC structure that holds triangles.
template <By by>
void notAMicromap(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    SharedMemory memory(gpu);
    const MicromapHandle generic = memory.create(0, 32768, VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR);
    const Blas plain(gpu, {Geometry{.vertices = triangleRow(1)}});
    Build inner(gpu, plain);
    inner.info.dstAccelerationStructure = generic.khr;
    gpu.submit([&](VkCommandBuffer commands) { inner.record(commands); });
    if (!wrong)
        buildAt(gpu, micromap, generic);
    attachTwin(gpu, micromap, generic, VK_INDEX_TYPE_UINT32, 1, by);
}

// The micromap of one element is the target of another one, or in its memory.
template <bool sameHandle>
void builtBesides(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    Micromap other(gpu, oneTriangle());
    other.build();
    const Blas blas(gpu, {withMicromap(&other)});
    Build build(gpu, blas);
    auto attached = *static_cast<const Khr *>(build.geometry.geometry.triangles.pNext);
    attached.micromap = twins.built.khr;
    build.geometry.geometry.triangles.pNext = &attached;
    const StructureBuild micromap(other.buildInfo(), !wrong       ? other.handle().khr
                                                     : sameHandle ? twins.built.khr
                                                                  : twins.other.khr);
    const VkAccelerationStructureBuildGeometryInfoKHR infos[] = {build.info, micromap.info};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges[] = {build.ranges, nullptr};
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 2, infos, ranges);
    });
}

// --- pNext chains ---

// The attachment is in another chain than that of the triangles.
template <By by>
void attachToGeometry(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas blas(gpu, {withMicromap(&micromap)});
    Build build(gpu, blas, by);
    if (wrong)
        std::swap(build.geometry.pNext, build.geometry.geometry.triangles.pNext);
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

template <By by>
void attachToBuild(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas blas(gpu, {withMicromap(&micromap)});
    Build build(gpu, blas, by);
    if (wrong)
        std::swap(build.info.pNext, build.geometry.geometry.triangles.pNext);
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

// Adds an attachment of a null micromap to the chain of a member of a geometry.
template <auto chainOf>
void attachTo(Gpu &gpu, const Structure &structure, bool wrong)
{
    const auto ext = vkInit<Ext>({.indexType = VK_INDEX_TYPE_NONE_KHR});
    const auto khr = vkInit<Khr>({.indexType = VK_INDEX_TYPE_NONE_KHR});
    Build build(gpu, structure);
    if (wrong)
        chainOf(build.geometry.geometry) = gpu.khr() ? static_cast<const void *>(&khr) : &ext;
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

void attachToInstances(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    attachTo < [](VkAccelerationStructureGeometryDataKHR & data) -> auto &
    {
        return data.instances.pNext;
    }
    > (gpu, tlas, wrong);
}

void attachToBoxes(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.boxes = {{0, 0, 0, 1, 1, 1}}}});
    attachTo < [](VkAccelerationStructureGeometryDataKHR & data) -> auto &
    {
        return data.aabbs.pNext;
    }
    > (gpu, blas, wrong);
}

// The data of a micromap is in the chain of the build.
void dataOfBuild(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    auto again = build.data;
    again.pNext = nullptr;
    if (wrong)
        build.info.pNext = &again;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &ranges);
    });
}

// A null micromap is attached by the structure of the extension that is not enabled.
void attachByOther(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {withMicromap(nullptr, {-1})});
    Build build(gpu, blas);
    const void *given = build.geometry.geometry.triangles.pNext;
    auto ext = vkInit<Ext>({.indexType = VK_INDEX_TYPE_UINT32, .indexStride = 4});
    auto khr = vkInit<Khr>({.indexType = VK_INDEX_TYPE_UINT32, .indexStride = 4});
    if (gpu.khr())
        ext.indexBuffer.deviceAddress = static_cast<const Khr *>(given)->indexBuffer;
    else
        khr.indexBuffer = static_cast<const Ext *>(given)->indexBuffer.deviceAddress;
    if (wrong)
        build.geometry.geometry.triangles.pNext = gpu.khr() ? static_cast<const void *>(&ext) : &khr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

// --- Usage counts ---

// Two triangles with usage counts that differ from those of the geometry, or of its micromap. In builds of no
// triangles, counts that are not zero.
using TwoIndices = std::array<int32_t, 2>;
template <VkMicromapUsageEXT usage, VkIndexType type, TwoIndices indices, By by = By::Host>
void counts(Gpu &gpu, bool wrong)
{
    MicromapInput input = oneTriangle();
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    Micromap micromap(gpu, std::move(input));
    micromap.build();
    Geometry geometry{.vertices = triangleRow(2), .micromap = Attachment{.micromap = &micromap, .indexType = type}};
    if (type != VK_INDEX_TYPE_NONE_KHR)
        geometry.micromap->indices.assign(indices.begin(), indices.end());
    const Blas blas(gpu, {geometry});
    Build build(gpu, blas, by);
    auto attached = *static_cast<const Ext *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &attached;
    const VkMicromapUsageEXT stated = usage;
    if (wrong) {
        attached.usageCountsCount = stated.count == 0 ? 0 : 1;
        attached.pUsageCounts = &stated;
    }
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

// Without a micromap all triangles have special indices.
void countsOfNone(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {withMicromap(nullptr, {-1})});
    Build build(gpu, blas);
    auto attached = *static_cast<const Ext *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &attached;
    if (wrong) {
        attached.usageCountsCount = 1;
        attached.pUsageCounts = &kGood;
    }
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

// --- Updates ---

template <By by>
void update(Gpu &gpu, Blas &blas, const Geometry &geometry, Flags flags)
{
    blas.prepare({geometry}, flags, kUpdate);
    const Build build(gpu, blas, by);
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

template <By by>
void loses(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Blas blas(gpu, {withMicromap(&micromap)}, kReplaces);
    update<by>(gpu, blas, wrong ? Geometry{.vertices = triangleRow(1)} : withMicromap(&micromap), kReplaces);
}

template <By by, Flags flags = kReplaces>
void replacesNull(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Blas blas(gpu, {withMicromap(nullptr, {-1})}, flags);
    update<by>(gpu, blas, wrong ? withMicromap(&micromap) : withMicromap(nullptr, {-1}), flags);
}

template <By by, Flags flags = kReplaces>
void adds(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Geometry plain{.vertices = triangleRow(1)};
    Blas blas(gpu, {withMicromap(&micromap)}, flags); // large enough for the micromap
    blas.build({plain}, flags);
    update<by>(gpu, blas, wrong ? withMicromap(&micromap) : plain, flags);
}

template <By by>
void replaces(Gpu &gpu, bool wrong)
{
    Micromap one(gpu, oneTriangle()), other(gpu, oneTriangle());
    one.build();
    other.build();
    const Flags flags = wrong ? kUpdatable : kReplaces;
    Blas blas(gpu, {withMicromap(&one)}, flags);
    update<by>(gpu, blas, withMicromap(&other), flags);
}

// An update may change only the opacities of a micromap.
MicromapInput triangleOf(uint16_t level, uint16_t format)
{
    MicromapInput input;
    input.add(level, format, std::vector<uint8_t>(size_t{1} << (2 * level), 0));
    return input;
}
template <uint16_t level, uint16_t format>
void replacesData(Gpu &gpu, bool wrong)
{
    Micromap one(gpu, oneTriangle()), other(gpu, wrong ? triangleOf(level, format) : triangleOf(2, kFourState));
    one.build();
    other.build();
    Blas blas(gpu, {withMicromap(&one)}, kReplacesData);
    update<By::Host>(gpu, blas, withMicromap(&other), kReplacesData);
}
void rebuildsData(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Blas blas(gpu, {withMicromap(&micromap)}, kReplacesData);
    if (!micromap.setInput(triangleOf(wrong ? 1 : 2, kFourState)))
        throw std::runtime_error("a smaller micromap needs more memory");
    micromap.build();
    update<By::Host>(gpu, blas, withMicromap(&micromap), kReplacesData);
}

#define EXT_CHANGE(...) [](Ext &attached) { __VA_ARGS__; }
#define KHR_CHANGE(...) [](Khr &attached) { __VA_ARGS__; }

const WrongProgram kPrograms[] = {
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10719", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexType = VK_INDEX_TYPE_UINT8_EXT)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10722", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexStride = 6)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10723", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexStride = VkDeviceSize{1} << 32)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10904", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexType = VK_INDEX_TYPE_NONE_KHR)>, "", "", false, "ext"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10905", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexBuffer.deviceAddress = 0)>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10904", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexType = VK_INDEX_TYPE_NONE_KHR), By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10905", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.indexBuffer.deviceAddress = 0), By::Indirect>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-pUsageCounts-07335", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.ppUsageCounts = &kGoodPointer)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-format-11679", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.pUsageCounts = &kNoFormat)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11680", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.pUsageCounts = &kTooDeepTwoState)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11681", Api::Ext, kNeedsNothing,
     attach<Ext, EXT_CHANGE(attached.pUsageCounts = &kTooDeepFourState)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11632", Api::Ext, kNeedsNothing, notBuilt<By::Host>},
    {"VUID-VkAccelerationStructureGeometryKHR-pNext-pNext", Api::Ext, kNeedsNothing, attachToGeometry<By::Host>, "Ext"},
    {"VUID-VkAccelerationStructureGeometryKHR-pNext-pNext", Api::Khr, kNeedsNothing, attachToGeometry<By::Indirect>,
     "Khr"},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pNext-pNext", Api::Ext, kNeedsNothing, attachToBuild<By::Host>,
     "Ext"},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pNext-pNext", Api::Khr, kNeedsNothing,
     attachToBuild<By::Indirect>, "Khr"},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pNext-pNext", Api::Khr, kNeedsNothing, dataOfBuild, "Data"},
    {"VUID-VkAccelerationStructureGeometryInstancesDataKHR-pNext-pNext", Api::Ext, kNeedsNothing, attachToInstances,
     "Ext"},
    {"VUID-VkAccelerationStructureGeometryInstancesDataKHR-pNext-pNext", Api::Khr, kNeedsNothing, attachToInstances,
     "Khr"},
    {"VUID-VkAccelerationStructureGeometryAabbsDataKHR-pNext-pNext", Api::Ext, kNeedsNothing, attachToBoxes, "Ext"},
    {"VUID-VkAccelerationStructureGeometryAabbsDataKHR-pNext-pNext", Api::Khr, kNeedsNothing, attachToBoxes, "Khr"},
    {"VUID-VkAccelerationStructureGeometryTrianglesDataKHR-pNext-pNext", Api::Khr, kNeedsNothing, attachByOther,
     "ExtNotEnabled"},
    {"VUID-VkAccelerationStructureGeometryTrianglesDataKHR-pNext-pNext", Api::Ext, kNeedsNothing, attachByOther,
     "KhrNotEnabled"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{3, 2, kFourState}, kUint32, TwoIndices{0, 1}>,
     "TooMany"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{1, 2, kFourState}, kUint32, TwoIndices{0, 0}>,
     "TooFew"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{0, 2, kFourState}, kUint32, TwoIndices{0, 1}>, "None"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{2, 2, kFourState}, kUint32, TwoIndices{0, -1}>,
     "Special"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{2, 2, kFourState}, kUint16, TwoIndices{-4, 1}>,
     "Special16"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing,
     counts<{1, 2, kFourState}, kUint32, TwoIndices{0, 1}, By::Indirect>, "Indirect"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{1, 2, kFourState}, kNoIndices, TwoIndices{}>,
     "Numbers"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing,
     counts<{1, 2, kFourState}, kNoIndices, TwoIndices{}, By::Indirect>, "NumbersIndirect"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, counts<{2, 3, kFourState}, kUint32, TwoIndices{0, 1}>,
     "AnotherLevel"},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, countsOfNone, "NoMicromap"},
    {"attachment-update", Api::Ext, kNeedsNothing, replaces<By::Host>},
    {"attachment-update", Api::Ext, kNeedsNothing, replaces<By::Indirect>, "Indirect"},
    {"attachment-update", Api::Ext, kNeedsNothing, loses<By::Host>, "Loses"},
    {"attachment-update", Api::Ext, kNeedsNothing, adds<By::Host, kUpdatable>, "Adds"},
    {"attachment-update", Api::Ext, kNeedsNothing, adds<By::Indirect, kReplacesData>, "AddsIndirect"},
    {"attachment-update", Api::Ext, kNeedsNothing, replacesNull<By::Host, kReplacesData>, "Null"},
    {"attachment-update", Api::Ext, kNeedsNothing, replacesData<1, kFourState>, "Level"},
    {"attachment-update", Api::Ext, kNeedsNothing, replacesData<2, kTwoState>, "Format"},
    {"attachment-update", Api::Ext, kNeedsNothing, rebuildsData, "Rebuilt"},

    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexType-11570", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexType = static_cast<VkIndexType>(9))>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11573", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexStride = 6)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11574", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexStride = VkDeviceSize{1} << 32)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11571", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexType = VK_INDEX_TYPE_NONE_KHR)>, "", "", false, "ext"},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11572", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexBuffer = 0)>},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-11579", Api::Khr, kNeedsNothing,
     attach<Khr, KHR_CHANGE(attached.indexType = VK_INDEX_TYPE_NONE_KHR; attached.indexBuffer = 0;
                            attached.micromap = VK_NULL_HANDLE)>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11624", Api::Khr, kNeedsNothing, notAMicromap<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11701", Api::Khr, kNeedsNothing, notBuilt<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548", Api::Khr, kNeedsNothing,
     builtBesides<true>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11549", Api::Khr, kNeedsNothing,
     builtBesides<false>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11625", Api::Khr, kNeedsNothing, loses<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11626", Api::Khr, kNeedsNothing, replacesNull<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11627", Api::Khr, kNeedsNothing, adds<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11629", Api::Khr, kNeedsNothing, replaces<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11632", Api::Ext, kNeedsNothing,
     notBuilt<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11624", Api::Khr, kNeedsNothing,
     notAMicromap<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11625", Api::Khr, kNeedsNothing, loses<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11626", Api::Khr, kNeedsNothing,
     replacesNull<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11627", Api::Khr, kNeedsNothing, adds<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11629", Api::Khr, kNeedsNothing,
     replaces<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11701", Api::Khr, kNeedsNothing,
     notBuilt<By::Indirect>},
};

#undef EXT_CHANGE
#undef KHR_CHANGE

} // namespace

std::span<const WrongProgram> attachmentPrograms()
{
    return kPrograms;
}

} // namespace vt
