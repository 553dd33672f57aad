// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps by either extension.
#include <algorithm>

#include "layer/validation/rules/build_rules.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags kBuildFlags = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                                VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT |
                                VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
constexpr auto kDisplacement = static_cast<VkMicromapTypeEXT>(1000397000);
constexpr VkFlags64 kExtInput = VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
constexpr VkFlags64 kKhrInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

struct MicromapBuildIds {
    const char *size;
    const char *bound;
    const char *data;
    const char *triangles;
    const char *alignment;
    VkDeviceSize divisor;
    const char *inputUsage;
    VkFlags64 inputFlag;
    const char *inputFlagName;
    const char *trianglesRange;
    const char *stride;
    const char *strideMultiple;
    const char *scratch;
    const char *scratchAlignment;
    const char *scratchRange;
    const char *scratchUsage;
};

constexpr MicromapBuildIds kExtBuildIds{
    .size = "VUID-vkCmdBuildMicromapsEXT-pInfos-07461",
    .bound = "VUID-vkCmdBuildMicromapsEXT-pInfos-07508",
    .data = "VUID-vkCmdBuildMicromapsEXT-pInfos-10896",
    .triangles = "VUID-vkCmdBuildMicromapsEXT-pInfos-10897",
    .alignment = "VUID-vkCmdBuildMicromapsEXT-pInfos-07515",
    .divisor = 256,
    .inputUsage = "VUID-vkCmdBuildMicromapsEXT-data-07510",
    .inputFlag = kExtInput,
    .inputFlagName = "VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT",
    .trianglesRange = nullptr,
    .stride = nullptr,
    .strideMultiple = nullptr,
    .scratch = "VUID-vkCmdBuildMicromapsEXT-pInfos-07512",
    .scratchAlignment = "VUID-vkCmdBuildMicromapsEXT-pInfos-07514",
    .scratchRange = "VUID-vkCmdBuildMicromapsEXT-pInfos-07509",
    .scratchUsage = "VUID-vkCmdBuildMicromapsEXT-pInfos-07511",
};
constexpr MicromapBuildIds kHostIds{
    .size = "VUID-vkBuildMicromapsEXT-pInfos-07461",
    .bound = nullptr, // see the rules of host commands
    .data = "VUID-vkBuildMicromapsEXT-pInfos-07553",
    .triangles = "VUID-vkBuildMicromapsEXT-pInfos-07554",
    .alignment = nullptr,
    .divisor = 1,
    .inputUsage = nullptr,
    .inputFlag = 0,
    .inputFlagName = nullptr,
    .trianglesRange = nullptr,
    .stride = nullptr,
    .strideMultiple = nullptr,
    .scratch = "VUID-vkBuildMicromapsEXT-pInfos-07556",
    .scratchAlignment = nullptr,
    .scratchRange = nullptr,
    .scratchUsage = nullptr,
};
constexpr MicromapBuildIds kKhrBuildIds{
    .size = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
    .bound = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707",
    .data = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
    .triangles = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
    .alignment = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552",
    .divisor = 128,
    .inputUsage = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11551",
    .inputFlag = kKhrInput,
    .inputFlagName = "VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR",
    .trianglesRange = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554",
    .stride = "VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646",
    .strideMultiple = "VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647",
    .scratch = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261",
    .scratchAlignment = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710",
    .scratchRange = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258",
    .scratchUsage = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261",
};

constexpr UsageIds kExtUsageIds{"VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516",
                                "VUID-VkMicromapBuildInfoEXT-format-11652",
                                "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654",
                                "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655",
                                nullptr,
                                nullptr};
constexpr UsageIds kKhrUsageIds{"VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642",
                                "VUID-VkMicromapUsageKHR-format-parameter",
                                "VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645",
                                "VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564",
                                "VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565",
                                "VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712"};

// Bytes that a build needs.
struct Needs {
    VkDeviceSize target = 0;
    VkDeviceSize scratch = 0;
};

void checkUsageArrays(const RuleCheck &check, uint32_t arrays, const UsageIds &ids)
{
    if (arrays != 1)
        check.fault("pUsageCounts", ids.arrays,
                    arrays == 0 ? "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given"
                                : "both pUsageCounts and ppUsageCounts are given");
}

bool checkInput(const RuleCheck &check, const MicromapBuildInput &build, const MicromapBuildIds &ids)
{
    const std::pair<const char *, VkDeviceAddress> inputs[] = {{"data", build.data.deviceAddress},
                                                               {"triangleArray", build.triangles.deviceAddress}};
    bool kept = check.require(inputs[0].second != 0, "data", ids.data, "the address is null") &&
                check.require(inputs[1].second != 0, "triangleArray", ids.triangles, "the address is null");
    for (const auto &[member, address] : inputs) {
        if (ids.alignment && address != 0)
            kept = checkMultiple(check, address, ids.divisor, member, ids.alignment) && kept;
        if (ids.inputUsage)
            checkUsage(check, address, ids.inputFlag, member, ids.inputUsage, ids.inputFlagName);
    }
    if (ids.stride && build.triangleStride < sizeof(VkMicromapTriangleEXT))
        check.fault("triangleArrayStride", ids.stride, std::to_string(build.triangleStride) + " is less than 8");
    if (ids.strideMultiple)
        checkMultiple(check, build.triangleStride, 4, "triangleArrayStride", ids.strideMultiple);
    if (ids.trianglesRange && kept)
        checkBytes(check, build.triangles.deviceAddress, build.triangleStride * build.triangleCount(), "triangleArray",
                   ids.trianglesRange);
    return kept;
}

void checkScratch(const RuleCheck &check, VkDeviceAddress scratch, VkDeviceSize bytes, const MicromapBuildIds &ids)
{
    if (bytes == 0 || !check.require(scratch != 0, "scratchData", ids.scratch, "the address is null"))
        return;
    if (ids.scratchAlignment)
        checkMultiple(check, scratch, check.device().limits.scratchAlignment, "scratchData", ids.scratchAlignment);
    if (ids.scratchUsage)
        checkUsage(check, scratch, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, "scratchData", ids.scratchUsage,
                   "VK_BUFFER_USAGE_STORAGE_BUFFER_BIT");
    if (ids.scratchRange)
        checkBytes(check, scratch, bytes, "scratchData", ids.scratchRange);
}

// What a build by either extension has in common, once its usage counts are right.
BuildMemory checkBuild(const RuleCheck &check, const MicromapBuildInput &build, const Needs &needs,
                       const MicromapBuildIds &ids, const char *target)
{
    if (build.target && build.target->size < needs.target)
        check.fault(target, ids.size,
                    "it was created with " + std::to_string(build.target->size) + " bytes; the build needs " +
                        std::to_string(needs.target));
    if (ids.bound)
        checkBound(check, build.target.get(), target, ids.bound);
    checkInput(check, build, ids);
    checkScratch(check, build.scratch.deviceAddress, needs.scratch, ids);
    const bool host = &ids == &kHostIds; // scratch memory of the host is not in a buffer
    return {build.target ? build.target->handle : ObjectHandle(), memoryOf(build.target.get(), needs.target),
            host ? MemoryRange{} : memoryAt(check.device(), build.scratch.deviceAddress, needs.scratch)};
}

Needs needsOf(const DeviceModel &device, const VkMicromapBuildInfoEXT &info, bool host)
{
    VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
    device.next.GetMicromapBuildSizesEXT(device.driver.handle,
                                         host ? VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR
                                              : VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                         &info, &sizes);
    return {sizes.micromapSize, sizes.buildScratchSize};
}

bool checkUsagesExt(const RuleCheck &check, const MicromapBuildInput &build)
{
    checkUsageArrays(check, build.usageArrays, kExtUsageIds);
    return checkUsages(check, build.usages, kExtUsageIds, check.device().limits.ext, false) && build.usageArrays > 0;
}

BuildMemory checkMicromapBuild(const RuleCheck &check, const VkMicromapBuildInfoEXT &info, bool host)
{
    const MicromapBuildInput build = micromapBuildOf(check.device(), info);
    checkStructure(check, info, kMicromapBuildInfo);
    check.require((info.flags & ~kBuildFlags) == 0, "flags", "VUID-VkMicromapBuildInfoEXT-flags-parameter",
                  "it has unknown bits");
    check.require(info.type == VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT || info.type == kDisplacement, "type",
                  "VUID-VkMicromapBuildInfoEXT-type-parameter", "it is not a type of micromaps");
    check.require(info.mode == VK_BUILD_MICROMAP_MODE_BUILD_EXT, "mode",
                  host ? "VUID-vkBuildMicromapsEXT-mode-07462" : "VUID-vkCmdBuildMicromapsEXT-mode-07462",
                  "it is not VK_BUILD_MICROMAP_MODE_BUILD_EXT");
    const char *targetId =
        host ? "VUID-vkBuildMicromapsEXT-dstMicromap-07463" : "VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463";
    if (!checkUsagesExt(check, build) ||
        !check.require(info.dstMicromap != VK_NULL_HANDLE, "dstMicromap", targetId, "it is VK_NULL_HANDLE"))
        return {};
    return checkBuild(check, build, needsOf(check.device(), info, host), host ? kHostIds : kExtBuildIds, "dstMicromap");
}

} // namespace

bool checkUsages(const RuleCheck &check, const std::vector<VkMicromapUsageEXT> &usages, const UsageIds &ids,
                 const MicromapRuleLimits &limits, bool lossy)
{
    bool kept = true;
    const auto fault = [&](uint32_t i, const char *member, const char *vuid, const std::string &text) {
        const Place place = check.place().element("pUsageCounts", i);
        check.at(place).fault(member, vuid, text);
        kept = false;
    };
    for (uint32_t i = 0; i < usages.size(); ++i) {
        const VkMicromapUsageEXT &usage = usages[i];
        const bool twoState = usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
        if (!twoState && usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT) {
            fault(i, "format", ids.format, std::to_string(usage.format) + " is neither 2-state nor 4-state");
            continue;
        }
        if (lossy && twoState)
            fault(i, "format", ids.lossyFormat, "it is 2-state; a lossy build takes 4-state triangles only");
        const uint32_t most = lossy ? limits.lossyLevel : twoState ? limits.twoStateLevel : limits.fourStateLevel;
        if (usage.subdivisionLevel > most)
            fault(i, "subdivisionLevel",
                  lossy      ? ids.lossyLevel
                  : twoState ? ids.twoStateLevel
                             : ids.fourStateLevel,
                  std::to_string(usage.subdivisionLevel) + " is above the limit " + std::to_string(most));
    }
    return kept;
}

void checkOverlaps(const RuleCheck &command, std::span<const BuildMemory> builds, const OverlapIds &ids)
{
    struct Piece {
        MemoryRange range;
        uint32_t build;
        bool scratch;
    };
    std::vector<Piece> pieces;
    for (uint32_t i = 0; i < builds.size(); ++i) {
        if (builds[i].targetRange.memory)
            pieces.push_back({builds[i].targetRange, i, false});
        if (builds[i].scratchRange.memory)
            pieces.push_back({builds[i].scratchRange, i, true});
    }
    std::ranges::sort(pieces, [](const Piece &a, const Piece &b) {
        return std::tie(a.range.memory, a.range.begin, a.build) < std::tie(b.range.memory, b.range.begin, b.build);
    });
    for (size_t p = 0; p < pieces.size(); ++p) {
        for (size_t q = p + 1; q < pieces.size() && pieces[p].range.overlaps(pieces[q].range); ++q) {
            const Piece &one = pieces[p].build > pieces[q].build ? pieces[p] : pieces[q];
            const Piece &other = pieces[p].build > pieces[q].build ? pieces[q] : pieces[p];
            const bool bothTargets = !one.scratch && !other.scratch;
            const bool same = bothTargets && builds[one.build].target.handle == builds[other.build].target.handle;
            const char *id = same && ids.sameTarget         ? ids.sameTarget
                             : bothTargets                  ? ids.targets
                             : one.scratch && other.scratch ? ids.scratches
                                                            : ids.targetAndScratch;
            const Place place = command.place().element("pInfos", one.build);
            command.at(place).fault(id, std::string(one.scratch ? "scratchData" : "the target") +
                                            " overlaps in memory " + (other.scratch ? "scratchData" : "the target") +
                                            " of pInfos[" + std::to_string(other.build) + "]");
        }
    }
}

void checkMicromapBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                         const VkMicromapBuildInfoEXT *infos)
{
    const bool host = commandBuffer == VK_NULL_HANDLE;
    const Place place(host ? "vkBuildMicromapsEXT" : "vkCmdBuildMicromapsEXT");
    const RuleCheck command(device, place, commandBuffer, commandBuffer);
    if (!host && !device.driver.enabled.extFeature)
        command.fault("VUID-vkCmdBuildMicromapsEXT-micromap-11648", "the feature micromap is not enabled");
    checkCount(device, host ? "vkBuildMicromapsEXT" : "vkCmdBuildMicromapsEXT", "infoCount", count,
               host ? "VUID-vkBuildMicromapsEXT-infoCount-arraylength"
                    : "VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength");
    std::vector<BuildMemory> builds;
    for (uint32_t i = 0; i < count; ++i) {
        const Place element = place.element("pInfos", i);
        builds.push_back(
            checkMicromapBuild(RuleCheck(device, element, infos[i].dstMicromap, commandBuffer), infos[i], host));
    }
    constexpr OverlapIds kDevice{nullptr, "VUID-vkCmdBuildMicromapsEXT-dstMicromap-11649",
                                 "VUID-vkCmdBuildMicromapsEXT-dstMicromap-11650",
                                 "VUID-vkCmdBuildMicromapsEXT-scratchData-11651"};
    constexpr OverlapIds kHost{nullptr, "VUID-vkBuildMicromapsEXT-dstMicromap-11667", nullptr, nullptr};
    checkOverlaps(command, builds, host ? kHost : kDevice);
}

void checkMicromapSizeQuery(DeviceModel &device, const VkMicromapBuildInfoEXT &info)
{
    const Place command("vkGetMicromapBuildSizesEXT");
    if (!device.driver.enabled.extFeature)
        device.fault(command, "VUID-vkGetMicromapBuildSizesEXT-micromap-11618", "the feature micromap is not enabled");
    const Place place = command.member("pBuildInfo");
    checkUsagesExt(RuleCheck(device, place), micromapBuildOf(device, info));
}

bool checkMicromapCounts(const RuleCheck &check, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                         const MicromapBuildInput &build)
{
    const MicromapRuleLimits &limits = check.device().limits.khr;
    const bool lossy = (info.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR) != 0;
    checkUsageArrays(check, build.usageArrays, kKhrUsageIds);
    const bool fits = build.triangleCount() <= limits.mostTriangles;
    if (!fits)
        check.fault("VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643",
                    "the usage counts add up to " + std::to_string(build.triangleCount()) +
                        " triangles, more than maxMicromapTriangles, " + std::to_string(limits.mostTriangles));
    return checkUsages(check, build.usages, kKhrUsageIds, limits, lossy) && build.usageArrays > 0 && fits;
}

BuildMemory checkMicromapData(const RuleCheck &check, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                              const MicromapBuildInput &build)
{
    const DeviceModel &device = check.device();
    if (!checkMicromapCounts(check, info, build) || !build.target)
        return {};
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    device.next.GetAccelerationStructureBuildSizesKHR(
        device.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, nullptr, &sizes);
    return checkBuild(check, build, {sizes.accelerationStructureSize, sizes.buildScratchSize}, kKhrBuildIds,
                      "dstAccelerationStructure");
}

} // namespace vellum::layer
