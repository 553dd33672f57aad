// SPDX-License-Identifier: Apache-2.0
// Translates builds of micromaps, and of structures that name them, to VK_EXT_opacity_micromap.
#include <algorithm>
#include <deque>
#include <string>

#include "layer/command_buffer/injected_work.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/khr_over_ext/placed_micromaps.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{
namespace
{

using Attachment = VkAccelerationStructureTrianglesOpacityMicromapEXT;

// VUID-vkCmdBuildMicromapsEXT-pInfos-07515; KHR requires 128.
constexpr VkDeviceSize kInputAlignment = 256;

// --- micromaps ---

// Returns whether the triangles must be copied, because the driver cannot read them in place. It also gets aligned
// addresses where there are no triangles.
bool mustBeMoved(const MicromapBuild &build)
{
    return build.data.deviceAddress % kInputAlignment != 0 || build.triangles.deviceAddress % kInputAlignment != 0 ||
           (build.extent.triangles > 0 &&
            (build.triangleStride < sizeof(VkMicromapTriangleKHR) || build.triangleStride % 4 != 0));
}

// Replaces the build's triangles by a copy as EXT requires them: packed, at an aligned address, with offsets from an
// aligned address of the data. False: no memory.
bool moveTriangles(DeviceKhrOverExt &device, VkCommandBuffer commandBuffer, InjectedWork &work, MicromapBuild &build)
{
    const uint64_t triangles = build.extent.triangles;
    const auto state = device.commands.states.get(commandBuffer);
    const VkDeviceAddress copy = state ? state->scratch.allocate(triangles * sizeof(VkMicromapTriangleKHR)) : 0;
    if (!copy)
        return false;
    shared::MicromapTrianglesPush push{};
    push.source = build.triangles.deviceAddress;
    push.target = copy;
    push.stride = static_cast<uint32_t>(build.triangleStride);
    push.count = static_cast<uint32_t>(triangles);
    push.shift = static_cast<uint32_t>(build.data.deviceAddress % kInputAlignment);
    push.readable =
        device.buffers.addresses.elementsFrom(push.source, sizeof(VkMicromapTriangleKHR), build.triangleStride);
    build.data.deviceAddress -= push.shift;
    build.triangles.deviceAddress = copy;
    build.triangleStride = sizeof(VkMicromapTriangleKHR);
    return triangles == 0 || work.dispatch(InjectedShader::MicromapTriangles, push, triangles, 64);
}

// `target`: null for a query of sizes, which ignores it and all addresses.
VkMicromapBuildInfoEXT driverInfo(const MicromapBuild &build, VkMicromapEXT target)
{
    VkMicromapBuildInfoEXT info{VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT};
    info.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    // A lossy build may be lossless.
    info.flags = build.flags & ~kLossyBuild;
    info.mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT;
    info.dstMicromap = target;
    info.usageCountsCount = static_cast<uint32_t>(build.usages.size());
    info.pUsageCounts = build.usages.data();
    info.data = build.data;
    info.scratchData.deviceAddress = build.scratch;
    info.triangleArray = build.triangles;
    info.triangleArrayStride = build.triangleStride;
    return info;
}

// --- other structures ---

// EXT requires the exact number of triangles of a geometry that have each level and format, and drivers compute sizes
// from it; but the device reads the indices that determine it later. The result is therefore an upper bound: every
// triangle of the geometry has each level and format of the micromap, or all possible ones if the micromap is unknown.
// Without indices the counts of the micromap's own build would be fewer, but the micromap may be built again with more
// between the query of the structure's size and its build, and the build must not need more than the query returned.
std::vector<VkMicromapUsageEXT> mostUsages(const MicromapLimits &limits, const PlacedMicromap &micromap,
                                           uint32_t primitives)
{
    std::vector<VkMicromapUsageEXT> result = micromap.usages;
    if (!micromap.isKnown) {
        for (uint32_t level = 0; level <= limits.twoStateLevel; ++level)
            result.push_back({0, level, VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT});
        for (uint32_t level = 0; level <= limits.fourStateLevel; ++level)
            result.push_back({0, level, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT});
    }
    for (VkMicromapUsageEXT &usage : result)
        usage.count = primitives;
    return result;
}

// A build whose geometries name their micromaps as in EXT.
class AttachedBuild
{
public:
    AttachedBuild(DeviceKhrOverExt &device, const MicromapLimits &limits, StructureBuild &build,
                  const uint32_t *primitives)
        : build_(build)
    {
        build.info.flags &=
            ~static_cast<VkBuildAccelerationStructureFlagsKHR>(VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR);
        for (uint32_t g = 0; g < build.geometryCount(); ++g) {
            if (build.inputs[g].micromap)
                attach(device, limits, g, primitives ? primitives[g] : 0);
        }
    }

    // 8-bit indices, which EXT does not have: 32-bit ones will be written, and `attachment` will name them.
    struct Narrow {
        VkDeviceAddress indices;
        VkDeviceSize stride;
        uint32_t count;
        Attachment *attachment;
        const void **chain; // of the geometry, which begins with the attachment
    };
    [[nodiscard]] const std::vector<Narrow> &narrow() const { return narrow_; }
    [[nodiscard]] StructureBuild &build() const { return build_; }
    // Returns whether the driver could not create one of the micromaps.
    [[nodiscard]] bool lacksMicromap() const { return lacksMicromap_; }

private:
    void attach(DeviceKhrOverExt &device, const MicromapLimits &limits, uint32_t g, uint32_t primitives)
    {
        const MicromapAttachment &micromap = *build_.inputs[g].micromap;
        const input::Attachment &given = micromap.given;
        Attachment &ext = attachments_.emplace_back();
        ext = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT};
        ext.indexType = given.indexType;
        if (given.indexType != VK_INDEX_TYPE_NONE_KHR) {
            ext.indexBuffer = given.indexBuffer;
            ext.indexStride = given.indexStride;
        }
        ext.baseTriangle = given.baseTriangle;
        if (given.indexType == VK_INDEX_TYPE_UINT8_EXT) {
            ext.indexType = VK_INDEX_TYPE_UINT32;
            ext.indexStride = sizeof(uint32_t);
            narrow_.push_back({given.indexBuffer.deviceAddress, given.indexStride, primitives, &ext,
                               &build_.geometries[g].geometry.triangles.pNext});
        }
        std::vector<VkMicromapUsageEXT> &usages = usages_.emplace_back();
        // A query of sizes does not check its input, so the structure is looked up here.
        const auto structure = micromap.structure
                                   ? micromap.structure
                                   : device.objects.accelerationStructures.get(
                                         reinterpret_cast<VkAccelerationStructureKHR>(given.micromap.handle));
        if (structure && canHoldMicromap(*structure)) {
            const PlacedMicromap placed = lastMicromap(device, *structure);
            ext.micromap = placed.handle;
            lacksMicromap_ = lacksMicromap_ || !placed.handle;
            usages = mostUsages(limits, placed, primitives);
        }
        ext.usageCountsCount = static_cast<uint32_t>(usages.size());
        ext.pUsageCounts = usages.data();
        Chain &chain = *build_.inputs[g].chain;
        chain.prepend(reinterpret_cast<VkBaseInStructure *>(&ext));
        build_.geometries[g].geometry.triangles.pNext = chain.head();
    }

    StructureBuild &build_;
    std::deque<Attachment> attachments_;
    std::deque<std::vector<VkMicromapUsageEXT>> usages_;
    std::vector<Narrow> narrow_;
    bool lacksMicromap_ = false;
};

void widen(DeviceKhrOverExt &device, VkCommandBuffer commandBuffer, const char *command, InjectedWork &work,
           const AttachedBuild::Narrow &narrow)
{
    const auto state = device.commands.states.get(commandBuffer);
    const VkDeviceAddress wide =
        state ? state->scratch.allocate(std::max<VkDeviceSize>(narrow.count, 1) * sizeof(uint32_t)) : 0;
    shared::WideIndicesPush push{};
    push.source = narrow.indices;
    push.target = wide;
    push.stride = static_cast<uint32_t>(narrow.stride);
    push.count = narrow.count;
    push.readable = device.buffers.addresses.elementsFrom(narrow.indices, 1, narrow.stride);
    // Without triangles no index is read, and the address may be anything.
    if (wide &&
        (narrow.count == 0 || (narrow.indices && work.dispatch(InjectedShader::WideIndices, push, narrow.count, 64)))) {
        narrow.attachment->indexBuffer.deviceAddress = wide;
        return;
    }
    // The geometry has no micromap then: with another type of indices, the build would read beyond them or the
    // micromap.
    device.driver.report().error("VELLUM-out-of-memory",
                                 std::string(command) + (narrow.indices
                                                             ? ": no memory for the indices of micromaps"
                                                             : ": the indices of a micromap are at a null address"));
    *narrow.chain = narrow.attachment->pNext;
}

// Widens all narrow indices of the builds, with one barrier before and one after.
void widenIndices(DeviceKhrOverExt &device, VkCommandBuffer commandBuffer, const char *command,
                  const std::deque<AttachedBuild> &builds)
{
    if (std::ranges::all_of(builds, [](const AttachedBuild &build) { return build.narrow().empty(); }))
        return;
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    for (const AttachedBuild &build : builds) {
        for (const AttachedBuild::Narrow &narrow : build.narrow())
            widen(device, commandBuffer, command, work, narrow);
    }
    work.barrier();
}

} // namespace

std::optional<input::BuildNeeds> ExtBackend::needs(const input::MicromapBuild &given) const
{
    const MicromapBuild build = micromapBuildOf(given);
    if (!build.extent.countable())
        return std::nullopt;
    const VkMicromapBuildInfoEXT info = driverInfo(build, VK_NULL_HANDLE);
    VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
    device_.driver.next.GetMicromapBuildSizesEXT(device_.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                 &info, &sizes);
    return input::BuildNeeds{markedMicromapSize(sizes.micromapSize), sizes.micromapSize, sizes.buildScratchSize};
}

void ExtBackend::record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds)
{
    std::vector<PlacedMicromap> micromaps(builds.size());
    bool anyMoved = false;
    for (size_t i = 0; i < builds.size(); ++i) {
        PlacedMicromap &micromap = micromaps[i];
        // Handles of any types may overlap, so the driver gets one of exactly the size.
        micromap.bytes = std::max<VkDeviceSize>(builds[i].bytes, 1);
        micromap.isKnown = true;
        micromap.usages = builds[i].usages;
        if (mustBeMoved(builds[i])) {
            if (InjectedWork::rejectedIn(device_.commands, commandBuffer, command))
                continue;
            anyMoved = true;
        }
        micromap.handle = micromapOfSize(device_, *builds[i].structure, micromap.bytes);
        checkDriverMicromap(device_, command, *builds[i].structure, micromap.handle);
    }
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    std::vector<VkMicromapBuildInfoEXT> infos;
    for (size_t i = 0; i < builds.size(); ++i) {
        if (!micromaps[i].handle)
            continue;
        if (mustBeMoved(builds[i]) && !moveTriangles(device_, commandBuffer, work, builds[i])) {
            rejectCommand(device_.driver, command, builds[i].structure->handle, "VELLUM-out-of-memory",
                          "no memory for the triangles");
            builds[i].usages.clear(); // nothing is read
            builds[i].data.deviceAddress = builds[i].triangles.deviceAddress = 0;
            micromaps[i].isKnown = false;
        }
        infos.push_back(driverInfo(builds[i], micromaps[i].handle));
        setDriverMicromap(device_, *builds[i].structure, std::move(micromaps[i]));
    }
    if (anyMoved)
        work.barrier();
    if (!infos.empty())
        device_.driver.next.CmdBuildMicromapsEXT(commandBuffer, static_cast<uint32_t>(infos.size()), infos.data());
    work.barrier();
}

void ExtBackend::getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build, const uint32_t *primitives,
                          VkAccelerationStructureBuildSizesInfoKHR &sizes)
{
    const AttachedBuild attached(device_, limits_, build, primitives);
    device_.driver.next.GetAccelerationStructureBuildSizesKHR(device_.driver.handle, type, &build.driverInfo(),
                                                              primitives, &sizes);
}

void ExtBackend::record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds)
{
    std::deque<AttachedBuild> attached;
    for (StructureBuild &build : builds) {
        const std::vector<uint32_t> primitives = build.primitives();
        const AttachedBuild &added = attached.emplace_back(device_, limits_, build, primitives.data());
        if (added.lacksMicromap())
            rejectCommand(device_.driver, command, build.target->handle, "VELLUM-out-of-memory",
                          "the driver could not make the micromap of a geometry", build.element);
        if (added.lacksMicromap() ||
            (!added.narrow().empty() && InjectedWork::rejectedIn(device_.commands, commandBuffer, command))) {
            attached.pop_back();
            continue;
        }
        const bool named = std::ranges::any_of(
            build.inputs, [](const GeometryInput &input) { return input.micromap && input.micromap->structure; });
        becomesStructure(*build.target, build.type(), named || (build.source && namesMicromaps(*build.source)));
    }
    widenIndices(device_, commandBuffer, command, attached);
    DriverBuilds driverBuilds;
    for (const AttachedBuild &added : attached)
        driverBuilds.add(added.build().driverInfo(), added.build().ranges);
    driverBuilds.record(device_.driver, commandBuffer);
}

} // namespace vellum::layer
