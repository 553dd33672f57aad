#include <algorithm>
#include <deque>
#include <numeric>
#include <string>
#include <unordered_set>

#include "layer/micromaps/micromap_extent.h"
#include "layer/translation/device_translation.h"
#include "layer/translation/driver_attachments.h"
#include "layer/translation/placed_micromaps.h"
#include "layer/translation/translation.h"

namespace vellum::layer
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;
using MicromapData = VkAccelerationStructureGeometryMicromapDataKHR;

constexpr const char *kGeometries = "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788";
constexpr const char *kGeometriesText = "geometryCount is not 0, but a geometry is a null pointer";

// VUID-vkCmdBuildMicromapsEXT-pInfos-07515; KHR wants 128.
constexpr VkDeviceSize kInputAlignment = 256;

Judge judgeOf(const DeviceTranslation &device, const char *command, VkAccelerationStructureKHR structure,
              std::optional<uint32_t> element = std::nullopt)
{
    return {device.driver.report(), command, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
            reinterpret_cast<uint64_t>(structure), element};
}

// A micromap build as the driver is to get it.
TranslatedMicromapBuild driverBuild(const BuildInfo &info, VkMicromapEXT target)
{
    TranslatedMicromapBuild build(info, *micromapDataOf(info), target);
    // A micromap without losses is what a lossy build may give, too.
    build.info.flags &= ~kLossyBuild;
    // Their levels were not looked at.
    std::erase_if(build.usages, [](const VkMicromapUsageEXT &usage) { return usage.count == 0; });
    build.info.usageCountsCount = static_cast<uint32_t>(build.usages.size());
    build.info.pUsageCounts = build.usages.data();
    return build;
}

uint64_t trianglesOf(const TranslatedMicromapBuild &build)
{
    return std::accumulate(build.usages.begin(), build.usages.end(), uint64_t{0},
                           [](uint64_t sum, const VkMicromapUsageEXT &usage) { return sum + usage.count; });
}

VkMicromapBuildSizesInfoEXT driverSizes(const DeviceTranslation &device, const TranslatedMicromapBuild &build)
{
    // Addresses and the target are ignored.
    VkMicromapBuildInfoEXT info = build.info;
    info.dstMicromap = VK_NULL_HANDLE;
    VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
    device.driver.next.GetMicromapBuildSizesEXT(device.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                &info, &sizes);
    return sizes;
}

// Whether a micromap build may be measured, and the driver can do it.
bool mayMeasure(const DeviceTranslation &device, const Judge &judge, const BuildInfo &info)
{
    // Of a device with neither extension, for the sake of VK_KHR_device_address_commands.
    if (!device.driver.next.GetMicromapBuildSizesEXT)
        return judge.refuse("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559",
                            "VK_KHR_opacity_micromap is not enabled");
    return mayMeasureMicromap(device.driver, judge, info, device.limits);
}

bool mayBuildMicromap(const DeviceTranslation &device, const Judge &judge, const BuildInfo &info)
{
    if (!mayMeasure(device, judge, info))
        return false;
    // It is built.
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR &&
        !judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", "a micromap cannot be updated"))
        return false;
    const auto target = device.objects.accelerationStructures.get(info.dstAccelerationStructure);
    if (!target || !canHoldMicromap(*target))
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547",
                            "dstAccelerationStructure was created as neither OPACITY_MICROMAP nor GENERIC");
    const TranslatedMicromapBuild build = driverBuild(info, VK_NULL_HANDLE);
    const VkMicromapBuildSizesInfoEXT sizes = driverSizes(device, build);
    if (target->size < sizes.micromapSize)
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                            "dstAccelerationStructure has " + std::to_string(target->size) +
                                " bytes, the build needs " + std::to_string(sizes.micromapSize));
    const uint64_t triangles = trianglesOf(build);
    if (triangles == 0)
        return true;
    const MicromapData &data = *micromapDataOf(info);
    if (!mayReadInput(device.buffers.addresses, judge, info, sizes.buildScratchSize))
        return false;
    if (data.triangleArrayStride > UINT32_MAX && triangles > 1)
        return judge.refuse("VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits");
    return data.triangleArrayStride >= sizeof(VkMicromapTriangleKHR) ||
           judge.tolerate("VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646",
                          "triangleArrayStride " + std::to_string(data.triangleArrayStride) +
                              " is less than the 8 bytes of a VkMicromapTriangleKHR");
}

// Whether the driver can be given the triangles as they lie.
bool mustBeMoved(const TranslatedMicromapBuild &build)
{
    const VkDeviceSize stride = build.info.triangleArrayStride;
    return trianglesOf(build) > 0 &&
           (build.info.data.deviceAddress % kInputAlignment != 0 ||
            build.info.triangleArray.deviceAddress % kInputAlignment != 0 || stride < sizeof(VkMicromapTriangleKHR) ||
            stride % 4 != 0); // VUID-VkMicromapBuildInfoEXT-... of alignment
}

// Gives the build triangles that lie as EXT wants them: packed, at an aligned address, with offsets from an aligned
// address of the data.
bool moveTriangles(DeviceTranslation &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                   TranslatedMicromapBuild &build)
{
    const uint64_t triangles = trianglesOf(build);
    const auto state = device.commands.states.get(commandBuffer);
    const VkDeviceAddress copy =
        state && triangles <= UINT32_MAX ? state->scratch.allocate(triangles * sizeof(VkMicromapTriangleKHR)) : 0;
    if (!copy)
        return false;
    MicromapTrianglesPush push{};
    push.source = build.info.triangleArray.deviceAddress;
    push.target = copy;
    push.stride = static_cast<uint32_t>(build.info.triangleArrayStride);
    push.count = static_cast<uint32_t>(triangles);
    push.shift = static_cast<uint32_t>(build.info.data.deviceAddress % kInputAlignment);
    // Not past the end of the buffer.
    const VkDeviceSize bytes = device.buffers.addresses.bytesFrom(push.source);
    const uint64_t readable =
        bytes < sizeof(VkMicromapTriangleKHR)
            ? 0
            : (push.stride > 0 ? (bytes - sizeof(VkMicromapTriangleKHR)) / push.stride + 1 : UINT32_MAX);
    push.readable = static_cast<uint32_t>(std::min<uint64_t>(readable, UINT32_MAX));
    build.info.data.deviceAddress -= push.shift;
    build.info.triangleArray.deviceAddress = copy;
    build.info.triangleArrayStride = sizeof(VkMicromapTriangleKHR);
    return work.dispatch(InjectedShader::MicromapTriangles, push, triangles, 64);
}

// The builds of micromaps among those of one command, whose first one is its element `first`.
void buildMicromaps(DeviceTranslation &device, VkCommandBuffer commandBuffer, const char *command, uint32_t count,
                    const BuildInfo *infos, uint32_t first = 0)
{
    std::vector<TranslatedMicromapBuild> builds;
    std::vector<std::shared_ptr<AccelerationStructure>> targets;
    std::vector<PlacedMicromap> micromaps;
    std::vector<uint32_t> moved; // builds
    for (uint32_t i = 0; i < count; ++i) {
        if (!isMicromapBuild(infos[i]))
            continue;
        const Judge judge = judgeOf(device, command, infos[i].dstAccelerationStructure, first + i);
        if (!mayBuildMicromap(device, judge, infos[i]))
            continue;
        const auto target = device.objects.accelerationStructures.get(infos[i].dstAccelerationStructure);
        TranslatedMicromapBuild build = driverBuild(infos[i], VK_NULL_HANDLE);
        PlacedMicromap micromap;
        // Handles may reach into one another, whichever their types.
        micromap.bytes = std::max<VkDeviceSize>(driverSizes(device, build).micromapSize, 1);
        micromap.handle = build.info.dstMicromap = micromapOfSize(device, *target, micromap.bytes);
        if (!micromap.handle) {
            judge.refuse("VELLUM-out-of-memory", "the driver could not make a micromap");
            continue;
        }
        micromap.isKnown = true;
        micromap.usages = build.usages;
        if (mustBeMoved(build)) {
            if (InjectedWork::refusedIn(device.commands, commandBuffer, command))
                continue;
            moved.push_back(static_cast<uint32_t>(builds.size()));
        }
        targets.push_back(target);
        micromaps.push_back(std::move(micromap));
        builds.push_back(std::move(build));
    }
    if (builds.empty())
        return;
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    for (const uint32_t i : moved) {
        if (moveTriangles(device, commandBuffer, work, builds[i]))
            continue;
        device.driver.report().error("VELLUM-out-of-memory", std::string(command) + ": no memory for the triangles");
        VkMicromapBuildInfoEXT &info = builds[i].info;
        info.usageCountsCount = 0; // nothing is read
        info.data.deviceAddress = info.triangleArray.deviceAddress = 0;
        micromaps[i].isKnown = false;
    }
    for (size_t i = 0; i < builds.size(); ++i)
        becomesMicromap(device, *targets[i], std::move(micromaps[i]));
    if (!moved.empty())
        work.barrier();
    std::vector<VkMicromapBuildInfoEXT> driverInfos;
    for (const TranslatedMicromapBuild &build : builds)
        driverInfos.push_back(build.info);
    device.driver.next.CmdBuildMicromapsEXT(commandBuffer, static_cast<uint32_t>(driverInfos.size()),
                                            driverInfos.data());
    work.barrier();
}

// The builds of other structures among those of one command.
class StructureBuilds
{
public:
    StructureBuilds(DeviceTranslation &device, VkCommandBuffer commandBuffer, const char *command, uint32_t count,
                    const BuildInfo *infos)
        : device_(device), commandBuffer_(commandBuffer), command_(command), count_(count), infos_(infos)
    {
        for (uint32_t i = 0; i < count; ++i) {
            if (isMicromapBuild(infos[i]))
                built_.insert(infos[i].dstAccelerationStructure);
        }
    }

    // `primitives(i)`: the most of each geometry of element i; empty where there are none.
    template <typename Primitives>
    void prepare(Primitives primitives)
    {
        for (uint32_t i = 0; i < count_; ++i) {
            if (isMicromapBuild(infos_[i]))
                continue;
            const Judge judge = judgeOf(device_, command_, infos_[i].dstAccelerationStructure, i);
            const auto target = device_.objects.accelerationStructures.get(infos_[i].dstAccelerationStructure);
            if (!mayBuild(judge, infos_[i], target.get()))
                continue;
            const std::vector<uint32_t> most = primitives(i);
            if (most.empty() && infos_[i].geometryCount > 0) {
                // Only builds of micromaps have none.
                judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543",
                             "a null pointer in place of the geometries' numbers of primitives");
                continue;
            }
            AttachedBuild build(device_, infos_[i], most.data());
            if (!mayAttach(judge, build))
                continue;
            const auto source = device_.objects.accelerationStructures.get(infos_[i].srcAccelerationStructure);
            const bool updated = infos_[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
            becomesStructure(*target,
                             build.topLevel() ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                                              : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                             !build.named().empty() || (updated && source && namesMicromaps(*source)));
            elements_.push_back(i);
            builds_.push_back(std::move(build));
        }
        widenIndices();
        for (AttachedBuild &build : builds_)
            driverInfos_.push_back(build.info());
    }
    [[nodiscard]] const std::vector<uint32_t> &elements() const { return elements_; }
    [[nodiscard]] const std::vector<BuildInfo> &driverInfos() const { return driverInfos_; }

private:
    [[nodiscard]] bool mayBuild(const Judge &judge, const BuildInfo &info, const AccelerationStructure *target) const
    {
        // A micromap's handle means nothing to the driver.
        if (!isDrivers(target))
            return judge.refuse(
                "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-dstAccelerationStructure-parameter",
                "dstAccelerationStructure is not an acceleration structure of this device");
        if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR ||
            isDrivers(device_.objects.accelerationStructures.get(info.srcAccelerationStructure).get()))
            return true;
        return judge.refuse(info.srcAccelerationStructure
                                ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629"
                                : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630",
                            "srcAccelerationStructure is not an acceleration structure of this device that can be "
                            "updated");
    }

    [[nodiscard]] bool mayAttach(const Judge &judge, const AttachedBuild &build) const
    {
        if (build.lacksGeometry())
            return judge.refuse(kGeometries, kGeometriesText);
        // The driver does not know the type.
        if (build.hasMicromapGeometry())
            return judge.refuse(
                "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                "a geometry of type VK_GEOMETRY_TYPE_MICROMAP_KHR in a build that is none of a micromap");
        for (const AttachedBuild::Named &named : build.named()) {
            const std::string where = "geometry " + std::to_string(named.geometry) + ": ";
            const auto micromap = device_.objects.accelerationStructures.get(named.micromap);
            if (!micromap || !canHoldMicromap(*micromap) || !lastMicromap(device_, *micromap).handle)
                return judge.refuse("VELLUM-VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter",
                                    where + "micromap is not a micromap of this device");
            // Here they are built first, with a barrier.
            if (built_.contains(named.micromap) &&
                !judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548",
                                where + "micromap is built by the same command"))
                return false;
        }
        if (build.narrow().empty())
            return true;
        return !InjectedWork::refusedIn(device_.commands, commandBuffer_, command_);
    }

    void widenIndices()
    {
        if (std::ranges::all_of(builds_, [](const AttachedBuild &build) { return build.narrow().empty(); }))
            return;
        InjectedWork work(device_.commands, commandBuffer_);
        work.barrier();
        for (const AttachedBuild &build : builds_) {
            for (const AttachedBuild::Narrow &narrow : build.narrow())
                widen(work, narrow);
        }
        work.barrier();
    }

    void widen(InjectedWork &work, const AttachedBuild::Narrow &narrow)
    {
        const auto state = device_.commands.states.get(commandBuffer_);
        const VkDeviceAddress wide =
            state ? state->scratch.allocate(std::max<VkDeviceSize>(narrow.count, 1) * sizeof(uint32_t)) : 0;
        WideIndicesPush push{};
        push.source = narrow.indices;
        push.target = wide;
        push.stride = static_cast<uint32_t>(narrow.stride);
        push.count = narrow.count;
        const VkDeviceSize bytes = device_.buffers.addresses.bytesFrom(narrow.indices);
        const VkDeviceSize readable =
            bytes == 0 ? 0 : (narrow.stride > 0 ? (bytes - 1) / narrow.stride + 1 : VkDeviceSize{UINT32_MAX});
        push.readable = static_cast<uint32_t>(std::min<VkDeviceSize>(readable, UINT32_MAX));
        // No index is read where there are none, and their address may be anything.
        if (wide && (narrow.count == 0 ||
                     (narrow.indices && work.dispatch(InjectedShader::WideIndices, push, narrow.count, 64)))) {
            narrow.attachment->indexBuffer.deviceAddress = wide;
            return;
        }
        // No index is read, and no micromap.
        device_.driver.report().error(
            "VELLUM-out-of-memory", std::string(command_) + (narrow.indices ? ": no memory for the indices of micromaps"
                                                                            : ": the indices of a micromap are at a "
                                                                              "null address"));
        narrow.attachment->indexType = VK_INDEX_TYPE_NONE_KHR;
        narrow.attachment->indexBuffer.deviceAddress = 0;
    }

    DeviceTranslation &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    uint32_t count_;
    const BuildInfo *infos_;
    std::unordered_set<VkAccelerationStructureKHR> built_; // micromaps, by the same command
    std::deque<AttachedBuild> builds_;
    std::vector<uint32_t> elements_; // of `infos_`, those that are built
    std::vector<BuildInfo> driverInfos_;
};

void restartScratch(DeviceTranslation &device, VkCommandBuffer commandBuffer)
{
    if (const auto state = device.commands.states.get(commandBuffer))
        state->scratch.restart();
}

} // namespace

void getTranslatedBuildSizes(DeviceTranslation &device, VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                             const BuildInfo *info, const uint32_t *maxPrimitives,
                             VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    constexpr const char *kCommand = "vkGetAccelerationStructureBuildSizesKHR";
    if (isMicromapBuild(*info)) {
        sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
        if (!mayMeasure(device, {device.driver.report(), kCommand}, *info))
            return;
        const VkMicromapBuildSizesInfoEXT driver = driverSizes(device, driverBuild(*info, VK_NULL_HANDLE));
        sizes->accelerationStructureSize = markedMicromapSize(driver.micromapSize);
        sizes->buildScratchSize = driver.buildScratchSize;
        return;
    }
    AttachedBuild build(device, *info, maxPrimitives);
    if (build.lacksGeometry()) {
        Judge(device.driver.report(), kCommand).refuse(kGeometries, kGeometriesText);
        sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
        return;
    }
    if (build.hasMicromapGeometry()) {
        device.driver.report().error("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                                     std::string(kCommand) +
                                         ": a geometry of type VK_GEOMETRY_TYPE_MICROMAP_KHR in a build that is none "
                                         "of a micromap");
        sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
        return;
    }
    // Both are ignored, and may be handles of the layer's own.
    BuildInfo driverInfo = build.info();
    driverInfo.srcAccelerationStructure = driverInfo.dstAccelerationStructure = VK_NULL_HANDLE;
    device.driver.next.GetAccelerationStructureBuildSizesKHR(handle, type, &driverInfo, maxPrimitives, sizes);
}

void cmdBuildTranslatedStructures(DeviceTranslation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                  const BuildInfo *infos, const RangeInfo *const *ranges)
{
    constexpr const char *kCommand = "vkCmdBuildAccelerationStructuresKHR";
    restartScratch(device, commandBuffer);
    buildMicromaps(device, commandBuffer, kCommand, count, infos);
    StructureBuilds builds(device, commandBuffer, kCommand, count, infos);
    builds.prepare([&](uint32_t i) {
        std::vector<uint32_t> primitives;
        for (uint32_t g = 0; ranges && ranges[i] && g < infos[i].geometryCount; ++g)
            primitives.push_back(ranges[i][g].primitiveCount);
        return primitives;
    });
    if (builds.elements().empty())
        return;
    // Of builds without geometries there may be none.
    const RangeInfo none{};
    std::vector<const RangeInfo *> driverRanges;
    for (const uint32_t i : builds.elements())
        driverRanges.push_back(ranges && ranges[i] ? ranges[i] : &none);
    device.driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer, static_cast<uint32_t>(driverRanges.size()),
                                                         builds.driverInfos().data(), driverRanges.data());
}

void cmdBuildTranslatedStructuresIndirect(DeviceTranslation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                          const BuildInfo *infos, const VkDeviceAddress *addresses,
                                          const uint32_t *strides, const uint32_t *const *most)
{
    constexpr const char *kCommand = "vkCmdBuildAccelerationStructuresIndirectKHR";
    restartScratch(device, commandBuffer);
    for (uint32_t i = 0; i < count; ++i) {
        // It has no ranges that could be indirect.
        if (isMicromapBuild(infos[i]) &&
            judgeOf(device, kCommand, infos[i].dstAccelerationStructure, i)
                .tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557",
                          "a micromap is not built indirectly"))
            buildMicromaps(device, commandBuffer, kCommand, 1, &infos[i], i);
    }
    StructureBuilds builds(device, commandBuffer, kCommand, count, infos);
    builds.prepare([&](uint32_t i) {
        return most && most[i] ? std::vector<uint32_t>(most[i], most[i] + infos[i].geometryCount)
                               : std::vector<uint32_t>{};
    });
    const uint32_t none = 0;
    std::vector<VkDeviceAddress> driverAddresses;
    std::vector<uint32_t> driverStrides;
    std::vector<const uint32_t *> driverMost;
    for (const uint32_t i : builds.elements()) {
        driverAddresses.push_back(addresses ? addresses[i] : 0);
        driverStrides.push_back(strides ? strides[i] : 0);
        driverMost.push_back(most && most[i] ? most[i] : &none);
    }
    if (!driverMost.empty())
        device.driver.next.CmdBuildAccelerationStructuresIndirectKHR(
            commandBuffer, static_cast<uint32_t>(driverMost.size()), builds.driverInfos().data(),
            driverAddresses.data(), driverStrides.data(), driverMost.data());
}

VkResult buildTranslatedStructures(DeviceTranslation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                   uint32_t count, const BuildInfo *infos, const RangeInfo *const *ranges)
{
    // A deferred build reads its input later: what the driver gets is the application's, unless there are micromaps,
    // which KHR does not let the host build or build with.
    for (uint32_t i = 0; i < count; ++i) {
        AttachedBuild build(device, infos[i], nullptr);
        if (build.lacksGeometry()) {
            judgeOf(device, "vkBuildAccelerationStructuresKHR", infos[i].dstAccelerationStructure, i)
                .refuse(kGeometries, kGeometriesText);
            return VK_ERROR_VALIDATION_FAILED_EXT;
        }
        const auto isOwn = [&](VkAccelerationStructureKHR structure) {
            return !isDrivers(device.objects.accelerationStructures.get(structure).get());
        };
        const bool own = isOwn(infos[i].dstAccelerationStructure) ||
                         (infos[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR &&
                          isOwn(infos[i].srcAccelerationStructure));
        if (!isMicromapBuild(infos[i]) && !own && !build.attaches() && !build.hasMicromapGeometry())
            continue;
        device.driver.report().notAvailable("vkBuildAccelerationStructuresKHR with micromaps");
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }
    for (uint32_t i = 0; i < count; ++i) {
        AttachedBuild build(device, infos[i], nullptr);
        becomesStructure(*device.objects.accelerationStructures.get(infos[i].dstAccelerationStructure),
                         build.topLevel() ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                                          : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                         false);
    }
    return device.driver.next.BuildAccelerationStructuresKHR(handle, operation, count, infos, ranges);
}

} // namespace vellum::layer
