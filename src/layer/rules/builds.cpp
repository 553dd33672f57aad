// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <unordered_set>

#include "layer/base/pnext.h"
#include "layer/rules/builds.h"
#include "layer/rules/ids.h"

namespace vellum::layer::rules
{
namespace
{

using enum Severity;

constexpr VkFlags kExtFlags = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                              VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT | VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
constexpr auto kDisplacement = static_cast<VkMicromapTypeEXT>(1000397000);
constexpr VkFlags64 kExtInput = VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
constexpr VkFlags64 kKhrInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

// Rules that builds of micromaps and of other structures have.
constexpr const char *kArrays = "VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788";
constexpr const char *kBound = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707";
constexpr const char *kTarget = "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03800";
constexpr const char *kNoStructure = "it is not an acceleration structure of this device";

struct Build {
    const input::MicromapBuild &build;
    const RuleDevice &device;
    const ObjectFacts &target;
    uint64_t triangles = build.usages.triangles();

    [[nodiscard]] const std::optional<MicromapSupport> &support() const { return device.support(build.khr); }
    // Without triangles no memory is accessed.
    [[nodiscard]] Severity ifRead(Severity severity) const { return triangles == 0 ? Report : severity; }
};

// ------------------------------------------------------------------------------------------ usage counts

struct Usage {
    const VkMicromapUsageEXT &usage;
    bool lossy;
    const std::optional<MicromapSupport> &support;
    const MicromapLimits *limits; // as the application sees them; null: unknown

    [[nodiscard]] bool isTwoState() const { return usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT; }
    [[nodiscard]] bool isFourState() const { return usage.format == VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT; }
};

Found unknownFormat(const Usage &c)
{
    return when(
        !c.isTwoState() && !c.isFourState(),
        [&] { return nameOfFormat(c.usage.format) + " is neither 2-state nor 4-state"; },
        !c.support || c.support->takesUnknownFormats ? Tolerate : Reject);
}

Found aboveLevel(const Usage &c, uint32_t MicromapLimits::*level)
{
    const auto above = [&c](uint32_t most, Severity severity) {
        return when(
            c.usage.subdivisionLevel > most,
            [&] { return std::to_string(c.usage.subdivisionLevel) + " is above the limit " + std::to_string(most); },
            severity);
    };
    // The size of a micromap with such triangles is undefined.
    const Found found = c.support ? above(c.support->limits.*level, c.usage.count == 0 ? Tolerate : Reject) : Found{};
    return found || !c.limits ? found : above(c.limits->*level, Report);
}
Found aboveTwoStateLevel(const Usage &c)
{
    return c.isTwoState() && !c.lossy ? aboveLevel(c, &MicromapLimits::twoStateLevel) : Found{};
}
// Unknown formats count as 4-state.
Found aboveFourStateLevel(const Usage &c)
{
    return !c.isTwoState() && !c.lossy ? aboveLevel(c, &MicromapLimits::fourStateLevel) : Found{};
}

constexpr Rule<Usage> kExtUsages[] = {
    {"VUID-VkMicromapBuildInfoEXT-format-11652", Depends, "format", unknownFormat},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654", Depends, "subdivisionLevel", aboveTwoStateLevel},
    {"VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655", Depends, "subdivisionLevel", aboveFourStateLevel},
};
constexpr Rule<Usage> kAttachedUsages[] = {
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-format-11679", Report, "format", unknownFormat},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11680", Report, "subdivisionLevel",
     aboveTwoStateLevel},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11681", Report, "subdivisionLevel",
     aboveFourStateLevel},
};
constexpr Rule<Usage> kKhrUsages[] = {
    {"VUID-VkMicromapUsageKHR-format-parameter", Depends, "format", unknownFormat},
    // Lossy builds do not change 2-state triangles.
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712", Tolerate, "format",
     [](const Usage &c) {
         return when(c.lossy && c.isTwoState(), "it is 2-state; a lossy build takes 4-state triangles only");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565", Depends, "subdivisionLevel",
     [](const Usage &c) { return c.lossy ? aboveLevel(c, &MicromapLimits::lossyLevel) : Found{}; }},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645", Depends, "subdivisionLevel",
     aboveTwoStateLevel},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564", Depends, "subdivisionLevel",
     aboveFourStateLevel},
};

Found wrongArrays(const Build &c)
{
    const uint32_t arrays = c.build.usages.arrays();
    return when(arrays != 1,
                arrays == 0 ? "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given"
                            : "both pUsageCounts and ppUsageCounts are given",
                arrays == 0 ? Reject : Tolerate);
}

constexpr Rule<Build> kExtCounts[] = {
    {"VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516", Depends, "pUsageCounts", wrongArrays},
};
constexpr Rule<Build> kKhrCounts[] = {
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642", Depends, "pUsageCounts", wrongArrays},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643", Tolerate, nullptr,
     [](const Build &c) {
         const uint64_t most =
             c.device.validating ? c.device.khrLimits.mostTriangles : c.support()->limits.mostTriangles;
         return when(c.triangles > most, [&] {
             return "the usage counts add up to " + std::to_string(c.triangles) +
                    " triangles, more than maxMicromapTriangles, " + std::to_string(most);
         });
     }},
};

Verdict checkUsages(const InputCheck &check, std::span<const Rule<Usage>> rules, const input::UsageCounts &usages,
                    bool lossy, const std::optional<MicromapSupport> &support, const MicromapLimits &limits)
{
    Verdict verdict;
    for (uint32_t i = 0; i < usages.size() && (verdict.accepted || check.device().validating); ++i) {
        const Place place = check.place().element("pUsageCounts", i);
        verdict &= check.at(place).check(
            rules, Usage{usages[i], lossy, support, check.device().validating ? &limits : nullptr});
    }
    return verdict;
}

Verdict checkCounts(const InputCheck &check, const Build &c)
{
    Verdict verdict = check.check<Build>(c.build.khr ? std::span<const Rule<Build>>(kKhrCounts) : kExtCounts, c);
    const bool lossy = c.build.khr && (c.build.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR) != 0;
    if (verdict.accepted || check.device().validating)
        verdict &= checkUsages(check, c.build.khr ? std::span<const Rule<Usage>>(kKhrUsages) : kExtUsages,
                               c.build.usages, lossy, c.support(), check.device().limits(c.build.khr));
    return verdict;
}

// ------------------------------------------------------------------------------------------ what is built

constexpr Rule<Build> kExtInfo[] = {
    {"VUID-VkMicromapBuildInfoEXT-sType-sType", Report, "sType",
     [](const Build &c) {
         return when(c.build.sType != VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT, [&] {
             return "it is that of " + nameOf(c.build.sType) + ", not VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT";
         });
     }},
    {"VUID-VkMicromapBuildInfoEXT-pNext-pNext", Report, "pNext",
     [](const Build &c) { return when(c.build.hasChain, "it is not null; nothing extends this structure"); }},
    {"VUID-VkMicromapBuildInfoEXT-type-parameter", Reject, "type",
     [](const Build &c) {
         return when(c.build.type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT &&
                         (c.support() || c.build.type != kDisplacement),
                     [&] { return nameOf(c.build.type) + " is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT"; });
     }},
    {"VUID-VkMicromapBuildInfoEXT-flags-parameter", Tolerate, "flags",
     [](const Build &c) {
         return when((c.build.flags & ~kExtFlags) != 0, [&] { return hex(c.build.flags) + " has unknown bits"; });
     }},
};

// Only the build mode BUILD exists.
Found wrongMode(const Build &c)
{
    return when(!c.build.isBuild, "it is not VK_BUILD_MICROMAP_MODE_BUILD_EXT");
}
Found noTarget(const Build &c)
{
    return isUnknown(c.target, c.build.target ? "it is not a micromap of this device" : "it is VK_NULL_HANDLE");
}
constexpr Rule<Build> kExtBuild[] = {
    {"VUID-vkCmdBuildMicromapsEXT-mode-07462", Tolerate, "mode", wrongMode},
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", Reject, "dstMicromap", noTarget},
};
constexpr Rule<RuleDevice> kHostBuilds[] = {
    {"VUID-vkBuildMicromapsEXT-micromapHostCommands-07555", Reject, nullptr, lacksHostCommands},
};
constexpr Rule<Build> kExtHostBuild[] = {
    {"VUID-vkBuildMicromapsEXT-mode-07462", Tolerate, "mode", wrongMode},
    {"VUID-vkBuildMicromapsEXT-dstMicromap-07463", Reject, "dstMicromap", noTarget},
};

bool hasGeometryType(const Build &c)
{
    return c.build.geometry && c.build.geometry->geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR;
}
constexpr Rule<Build> kKhrInfo[] = {
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559", Depends, "type",
     [](const Build &c) {
         const bool missing = c.support() && !c.support()->exists;
         return when(missing || !c.device.driver.enabled.khrFeature,
                     "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled",
                     missing ? Reject : Tolerate);
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560", Depends, "geometryCount",
     [](const Build &c) {
         return when(
             c.build.geometries != 1,
             [&] { return std::to_string(c.build.geometries) + "; a micromap has one geometry"; },
             c.build.geometries > 1 ? Tolerate : Reject);
     }},
    {kArrays, Depends, "pGeometries",
     [](const Build &c) {
         return when(c.build.geometries > 0 && (!c.build.geometry || c.build.twoArrays),
                     "not exactly one of pGeometries and ppGeometries is given", c.build.geometry ? Tolerate : Reject);
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561", Depends, "pGeometries[0].geometryType",
     [](const Build &c) {
         return when(c.build.geometry && !hasGeometryType(c),
                     "the geometry of a micromap is not of type VK_GEOMETRY_TYPE_MICROMAP_KHR",
                     c.build.hasData ? Tolerate : Reject);
     }},
    {"VUID-VkAccelerationStructureGeometryKHR-flags-11569", Report, "pGeometries[0].flags",
     [](const Build &c) {
         return when(hasGeometryType(c) && c.build.geometry->flags != 0, "the geometry of a micromap has flags");
     }},
    {"VUID-VkAccelerationStructureGeometryKHR-micromap-11568", Reject, "pGeometries[0].pNext",
     [](const Build &c) {
         return when(hasGeometryType(c) && !c.build.hasData,
                     "there is no VkAccelerationStructureGeometryMicromapDataKHR");
     }},
};
constexpr Rule<Build> kKhrBuild[] = {
    // The layer builds a micromap nevertheless.
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557", Tolerate, "type",
     [](const Build &c) { return when(c.build.indirect, "a micromap cannot be built indirectly"); }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", Tolerate, "mode",
     [](const Build &c) { return when(!c.build.isBuild, "a micromap cannot be updated"); }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-11546", Report, "srcAccelerationStructure",
     [](const Build &c) { return when(c.build.hasSource, "a micromap is built, but it is not VK_NULL_HANDLE"); }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11544", Report, "type",
     [](const Build &c) {
         return when(c.build.hasRanges && !c.build.indirect,
                     "a micromap is built, but its element of ppBuildRangeInfos is not null");
     }},
    {kTarget, Reject, "dstAccelerationStructure", [](const Build &c) { return isUnknown(c.target, kNoStructure); }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547", Reject, "dstAccelerationStructure",
     [](const Build &c) {
         return when(c.target.exists && !c.target.canHoldMicromap(),
                     "it was created neither as OPACITY_MICROMAP nor as GENERIC");
     }},
};

// ------------------------------------------------------------------------------------------ memory

Found tooSmall(const Build &c)
{
    const VkDeviceSize size = c.target.size;
    return when(
        c.target.exists && size < c.build.needs.micromap,
        [&] {
            return "it was created with " + std::to_string(size) + " bytes; the build needs " +
                   std::to_string(c.build.needs.micromap);
        },
        size < c.build.needs.written ? Reject : Report);
}
Found notBound(const Build &c)
{
    return isUnbound(c.target);
}

constexpr const char *kNull = "the address is null";
// An address that the build does not access only must not be null. Host addresses cannot be checked.
Found isInvalid(const Build &c, VkDeviceAddress address)
{
    return c.triangles == 0 || c.build.host ? when(address == 0, kNull, c.ifRead(Reject))
                                            : isInvalid(c.device, address, Reject);
}
Found noData(const Build &c)
{
    return isInvalid(c, c.build.data.deviceAddress);
}
Found noTriangles(const Build &c)
{
    return isInvalid(c, c.build.triangles.deviceAddress);
}
// Returns the name of the inputs whose address is broken, by `broken(address)`; null: none is.
template <typename Broken>
const char *brokenInput(const Build &c, Broken broken)
{
    const bool data = broken(c.build.data.deviceAddress), triangles = broken(c.build.triangles.deviceAddress);
    return data ? (triangles ? "data and triangleArray" : "data") : triangles ? "triangleArray" : nullptr;
}
Found misaligned(const Build &c, uint64_t alignment)
{
    const char *input = brokenInput(c, [&](VkDeviceAddress address) { return address % alignment != 0; });
    return when(
        input != nullptr,
        [&] {
            std::string addresses;
            for (const VkDeviceAddress address : {c.build.data.deviceAddress, c.build.triangles.deviceAddress})
                if (address % alignment != 0)
                    addresses += (addresses.empty() ? "" : " and ") + hex(address);
            return std::string(input) + ", at " + addresses + ": not a multiple of " + std::to_string(alignment);
        },
        c.ifRead(Tolerate));
}
Found withoutUsage(const Build &c, VkFlags64 usage, const char *usageName)
{
    const auto lacks = [&](VkDeviceAddress address) { return lacksUsage(c.device, address, usage); };
    const char *input = brokenInput(c, lacks);
    return when(input != nullptr,
                [&] { return std::string("the buffer of ") + input + " was created without " + usageName; });
}

bool needsScratch(const Build &c)
{
    return c.build.needs.scratch != 0;
}
Found noScratch(const Build &c)
{
    return needsScratch(c) ? isInvalid(c, c.build.scratch.deviceAddress) : Found{};
}
Found misalignedScratch(const Build &c)
{
    const VkDeviceAddress scratch = c.build.scratch.deviceAddress;
    if (!needsScratch(c) || scratch == 0)
        return {};
    const uint64_t alignment = std::max<uint64_t>(c.device.scratchAlignment, kLeastScratchAlignment);
    return when(
        scratch % alignment != 0, [&] { return hex(scratch) + " is not a multiple of " + std::to_string(alignment); },
        scratch % kLeastScratchAlignment != 0 ? c.ifRead(Reject) : Report);
}
Found scratchWithoutUsage(const Build &c)
{
    return when(needsScratch(c) &&
                    lacksUsage(c.device, c.build.scratch.deviceAddress, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT),
                "its buffer was created without VK_BUFFER_USAGE_STORAGE_BUFFER_BIT", Report);
}
Found smallScratch(const Build &c)
{
    const VkDeviceSize available = c.device.addresses.bytesFrom(c.build.scratch.deviceAddress);
    return when(
        available < c.build.needs.scratch, [&] { return tooFewBytes(available, c.build.needs.scratch); },
        c.ifRead(Reject));
}

// The shaders of the layer take 32 bits. Triangles may overlap, and all may be one: VK_EXT_opacity_micromap has no
// rule.
Found wrongStride(const Build &c)
{
    return when(c.support() && c.triangles > 1 && c.build.triangleStride > UINT32_MAX,
                [&] { return std::to_string(c.build.triangleStride) + " does not fit 32 bits"; });
}
constexpr const char *kStrideId = "VELLUM-micromap-stride";

constexpr Rule<Build> kExtMemory[] = {
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07461", Depends, "dstMicromap", tooSmall},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07508", Reject, "dstMicromap", notBound},
    {kExtDataId, Depends, "data", noData},
    {kExtTrianglesId, Depends, "triangleArray", noTriangles},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07515", Report, nullptr, [](const Build &c) { return misaligned(c, 256); }},
    {"VUID-vkCmdBuildMicromapsEXT-data-07510", Report, nullptr,
     [](const Build &c) {
         return withoutUsage(c, kExtInput, "VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT");
     }},
    {kExtScratchId, Depends, "scratchData", noScratch},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07514", Depends, "scratchData", misalignedScratch},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07511", Report, "scratchData", scratchWithoutUsage},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07509", Depends, "scratchData", smallScratch},
    {kStrideId, Reject, "triangleArrayStride", wrongStride},
};
constexpr Rule<Build> kExtHostMemory[] = {
    {"VUID-vkBuildMicromapsEXT-pInfos-07461", Depends, "dstMicromap", tooSmall},
    {"VUID-vkBuildMicromapsEXT-pInfos-07552", Reject, "dstMicromap",
     [](const Build &c) { return when(!c.target.hostVisible, "its buffer is not bound to host-visible memory"); }},
    {"VUID-vkBuildMicromapsEXT-pInfos-07553", Depends, "data", noData},
    {"VUID-vkBuildMicromapsEXT-pInfos-07554", Depends, "triangleArray", noTriangles},
    {kStrideId, Reject, "triangleArrayStride", wrongStride},
};
constexpr Rule<Build> kKhrMemory[] = {
    {kTargetSizeId, Depends, "dstAccelerationStructure", tooSmall},
    {kBound, Reject, "dstAccelerationStructure", notBound},
    {kKhrInputId, Depends, nullptr,
     [](const Build &c) {
         const Found data = noData(c);
         Found found = data ? data : noTriangles(c);
         if (found)
             found.text.insert(0, data && noTriangles(c) ? "data and triangleArray: "
                                  : data                 ? "data: "
                                                         : "triangleArray: ");
         return found;
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552", Depends, nullptr,
     [](const Build &c) { return misaligned(c, 128); }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11551", Report, nullptr,
     [](const Build &c) {
         return withoutUsage(c, kKhrInput, "VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR");
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554", Report, "triangleArray",
     [](const Build &c) {
         const VkDeviceAddress array = c.build.triangles.deviceAddress;
         const VkDeviceSize available = array % 128 == 0 ? c.device.addresses.bytesFrom(array) : UINT64_MAX;
         const uint64_t needed = c.build.triangleStride * c.triangles;
         return when(available < needed, [&] {
             return "its buffer has " + std::to_string(available) + " bytes from there; the build reads " +
                    std::to_string(needed);
         });
     }},
    {kScratchId, Depends, "scratchData",
     [](const Build &c) {
         const Found found = noScratch(c);
         return found ? found : scratchWithoutUsage(c);
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710", Depends, "scratchData", misalignedScratch},
    {kScratchSizeId, Depends, "scratchData", smallScratch},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646", Depends, "triangleArrayStride",
     [](const Build &c) {
         return when(
             c.build.triangleStride < sizeof(VkMicromapTriangleKHR),
             [&] { return std::to_string(c.build.triangleStride) + " is less than 8"; }, c.ifRead(Tolerate));
     }},
    {"VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647", Report, "triangleArrayStride",
     [](const Build &c) {
         return when(c.build.triangleStride % 4 != 0,
                     [&] { return std::to_string(c.build.triangleStride) + " is not a multiple of 4"; });
     }},
    {kStrideId, Reject, "triangleArrayStride", wrongStride},
};

// ------------------------------------------------------------------------------------------ flags

constexpr VkFlags kForMicromaps = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
constexpr VkFlags kUpdate = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR;
constexpr VkFlags kDataUpdate = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
constexpr VkFlags kDisable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR;
constexpr VkFlags kLossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

struct Flags {
    VkFlags flags;
    bool micromap; // the build is of one
    const EnabledFeatures &enabled;
};
constexpr Rule<Flags> kFlags[] = {
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11558", Report, "flags",
     [](const Flags &c) {
         return when((c.flags & kUpdate) != 0 && (c.flags & kDataUpdate) != 0,
                     "ALLOW_OPACITY_MICROMAP_UPDATE and ALLOW_OPACITY_MICROMAP_DATA_UPDATE are both set");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562", Tolerate, "flags",
     [](const Flags &c) {
         return when(c.micromap && (c.flags & ~kForMicromaps) != 0,
                     [&] { return hex(c.flags) + " has bits that are not for micromaps"; });
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-03796", Report, "flags",
     [](const Flags &c) {
         return when((c.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR) != 0 &&
                         (c.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR) != 0,
                     "PREFER_FAST_TRACE and PREFER_FAST_BUILD are both set");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-11563", Report, "flags",
     [](const Flags &c) {
         return when(!c.micromap && (c.flags & kLossy) != 0,
                     "MICROMAP_LOSSY is set for a structure that is not a micromap");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11709", Report, "flags",
     [](const Flags &c) {
         return when(
             (c.flags & kDataUpdate) != 0 && !c.enabled.extFeature,
             "ALLOW_OPACITY_MICROMAP_DATA_UPDATE is set, the feature micromap of VK_EXT_opacity_micromap is not "
             "enabled");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11710", Report, "flags",
     [](const Flags &c) {
         return when((c.flags & kUpdate) != 0 && !c.enabled.anyFeature(),
                     "ALLOW_OPACITY_MICROMAP_UPDATE is set, no feature micromap is enabled");
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11711", Report, "flags",
     [](const Flags &c) {
         return when((c.flags & kDisable) != 0 && !c.enabled.anyFeature(),
                     "ALLOW_DISABLE_OPACITY_MICROMAPS is set, no feature micromap is enabled");
     }},
};

// ------------------------------------------------------------------------------------------ other structures

struct Structure {
    const input::StructureBuild &build;
    const RuleDevice &device;
    ObjectFacts target{};
    ObjectFacts source{}; // of an update
};

// `ofType`: the build is of the type that the rule is about.
Found wrongTarget(const Structure &c, bool ofType)
{
    return when(ofType && c.target.isMicromap(), "it was created as OPACITY_MICROMAP, and something else is built");
}

// VK_AMDX_dense_geometry_format: triangles whose build has no ranges. They are in the chain of their geometry, and so
// are the structures that extend them.
constexpr auto kDenseGeometry = static_cast<VkGeometryTypeKHR>(1000478000);
constexpr auto kDenseTriangles = static_cast<VkStructureType>(1000478001);

bool needsRanges(const input::StructureBuild &build)
{
    return std::ranges::any_of(build.geometries, [](const input::Geometry &geometry) {
        return !geometry.given || geometry.given->geometryType != kDenseGeometry;
    });
}

constexpr Rule<Structure> kStructure[] = {
    {kTarget, Reject, "dstAccelerationStructure", [](const Structure &c) { return isUnknown(c.target, kNoStructure); }},
    // The driver does not know the handles of emulated and translated micromaps.
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03699", Reject, "dstAccelerationStructure",
     [](const Structure &c) {
         return wrongTarget(c, c.build.given->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03700", Reject, "dstAccelerationStructure",
     [](const Structure &c) {
         return wrongTarget(c, c.build.given->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543", Reject, nullptr,
     [](const Structure &c) {
         return when(!c.build.ranges.given() && needsRanges(c.build),
                     "the element of ppBuildRangeInfos is null, and the structure is not a micromap");
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630", Reject, "srcAccelerationStructure",
     [](const Structure &c) {
         return when(c.build.isUpdate() && !c.build.given->srcAccelerationStructure, "an update has no source");
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629", Reject, "srcAccelerationStructure",
     [](const Structure &c) {
         constexpr const char *kOther = "it is not an acceleration structure of this device that can be updated";
         if (!c.build.isUpdate() || !c.build.given->srcAccelerationStructure)
             return Found{};
         const Found unknown = isUnknown(c.source, kOther);
         return unknown ? unknown : when(c.source.isMicromap(), kOther);
     }},
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03790", Reject, "geometryCount",
     [](const Structure &c) {
         const bool topLevel =
             c.build.isTopLevel() || c.build.given->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
         return when(topLevel && c.build.geometries.size() != 1, [&] {
             return std::to_string(c.build.geometries.size()) + "; a top-level structure has one geometry";
         });
     }},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-mode-04628", Report, "mode",
     [](const Structure &c) {
         return when(!c.build.isUpdate() && c.build.given->mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                     "it is neither BUILD nor UPDATE");
     }},
    {kBound, Reject, "dstAccelerationStructure", [](const Structure &c) { return isUnbound(c.target); }},
};
constexpr Rule<Structure> kGeometries[] = {
    {kArrays, Depends, "pGeometries",
     [](const Structure &c) {
         const bool isNull =
             std::ranges::any_of(c.build.geometries, [](const auto &geometry) { return !geometry.given; });
         const bool both = !c.build.geometries.empty() && c.build.given->pGeometries && c.build.given->ppGeometries;
         return when(isNull || both,
                     isNull ? "geometryCount is not 0, but a geometry is a null pointer"
                            : "pGeometries and ppGeometries are both given",
                     isNull ? Reject : Report);
     }},
    // The driver does not know this type.
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707", Reject, "pGeometries",
     [](const Structure &c) {
         const auto found = std::ranges::find_if(c.build.geometries, [](const input::Geometry &geometry) {
             return geometry.given && geometry.given->geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR;
         });
         return when(found != c.build.geometries.end(), [&] {
             return "geometry " + std::to_string(found - c.build.geometries.begin()) +
                    " is of type VK_GEOMETRY_TYPE_MICROMAP_KHR; the structure is not a micromap";
         });
     }},
};

// ------------------------------------------------------------------------------------------ attachments

// The objects of a command.
struct Objects {
    const Facts &facts;
    const std::unordered_set<uint64_t> &built; // micromaps that it builds
};
struct Attached {
    const input::Attachment &attachment;
    const RuleDevice &device;
    const input::BuildRanges &ranges;
    uint32_t geometry;
    const Objects *objects; // null on the host

    [[nodiscard]] bool indexed() const { return attachment.indexType != VK_INDEX_TYPE_NONE_KHR; }
    // Bytes of an index; 0 for types that the extension does not take.
    [[nodiscard]] uint32_t indexBytes() const
    {
        return attachment.indexType == VK_INDEX_TYPE_UINT8_EXT && !attachment.khr
                   ? 0
                   : input::indexBytes(attachment.indexType);
    }
};

Found unneededIndices(const Attached &c)
{
    return when(!c.indexed() && c.attachment.indexBuffer.deviceAddress != 0,
                "it is not null, although indexType is VK_INDEX_TYPE_NONE_KHR");
}
// Null is not a buffer, and a geometry without triangles reads none.
Found noIndices(const Attached &c)
{
    const VkDeviceAddress indices = c.attachment.indexBuffer.deviceAddress;
    const bool read = indices != 0 && c.ranges.primitives(c.geometry) > 0;
    return c.indexBytes() != 0 && c.attachment.indexStride <= UINT32_MAX
               ? isInvalid(c.device, indices, read ? Reject : Report)
               : Found{};
}
Found noMicromap(const Attached &c)
{
    constexpr const char *kOther = "it is not a micromap of this device";
    if (!c.attachment.micromap)
        return {};
    const ObjectFacts facts = c.objects->facts(c.attachment.micromap);
    const Found unknown = isUnknown(facts, kOther);
    return unknown ? unknown : when(!facts.canHoldMicromap(), kOther);
}
Found wrongIndexType(const Attached &c)
{
    return when(c.indexed() && c.indexBytes() == 0,
                [&] { return nameOf(c.attachment.indexType) + " is not allowed here"; });
}
Found wrongIndexStride(const Attached &c)
{
    return when(c.indexBytes() != 0 && c.attachment.indexStride % c.indexBytes() != 0, [&] {
        return std::to_string(c.attachment.indexStride) + " is not a multiple of " + std::to_string(c.indexBytes());
    });
}
Found largeIndexStride(const Attached &c)
{
    return when(c.indexBytes() != 0 && c.attachment.indexStride > UINT32_MAX,
                [&] { return std::to_string(c.attachment.indexStride) + " is above 2^32-1"; });
}

// The usage counts state how many triangles of the geometry have an index into the micromap: from `least` to `most`.
Found wrongCounts(const Attached &c, uint64_t least, uint64_t most)
{
    const uint64_t stated = c.attachment.usages.triangles();
    return when(stated < least || stated > most, [&] {
        return "they state " + std::to_string(stated) + " triangles; " + (least == most ? "" : "at most ") +
               std::to_string(most) + " of the geometry have an index into the micromap";
    });
}
// All triangles at most have one. Only the device knows how many do: the check `gpu` counts them.
Found wrongDeviceCounts(const Attached &c)
{
    return c.ranges.given() ? wrongCounts(c, 0, c.attachment.micromap ? c.ranges.primitives(c.geometry) : 0) : Found{};
}
// Special indices are the unsigned cast of -1 to -4 to an index type of 2 or 4 bytes.
bool isSpecialIndex(const char *index, uint32_t bytes)
{
    uint32_t value = 0;
    std::memcpy(&value, index, bytes); // of little-endian integers
    return value >= (bytes == 2 ? UINT16_MAX : UINT32_MAX) - 3u;
}
Found wrongHostCounts(const Attached &c)
{
    const uint32_t bytes = c.indexBytes();
    const auto *indices = static_cast<const char *>(c.attachment.indexBuffer.hostAddress);
    if (c.attachment.khr || !c.ranges.given() ||
        (c.indexed() && (bytes == 0 || !indices || c.attachment.indexStride > UINT32_MAX)))
        return {};
    uint64_t triangles = c.attachment.micromap ? c.ranges.primitives(c.geometry) : 0;
    for (uint64_t t = triangles; c.indexed() && t-- > 0;)
        if (isSpecialIndex(indices + t * c.attachment.indexStride, bytes))
            --triangles;
    return wrongCounts(c, triangles, triangles);
}

// Rules of the structure, on the device and on the host.
constexpr Rule<Attached> kExtStructure[] = {
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10719", Report, "indexType", wrongIndexType},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10722", Report, "indexStride",
     wrongIndexStride},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10723", Report, "indexStride",
     largeIndexStride},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-pUsageCounts-07335", Report, "pUsageCounts",
     [](const Attached &c) {
         return when(c.attachment.usages.arrays() > 1, "both pUsageCounts and ppUsageCounts are given");
     }},
};
constexpr Rule<Attached> kExtAttachment[] = {
    {ids::kAttachedCounts, Report, "pUsageCounts", wrongDeviceCounts},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-micromap-parameter", Reject, "micromap", noMicromap},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10904", Report, "indexBuffer", unneededIndices},
    {kExtIndicesId, Depends, "indexBuffer", noIndices},
};
constexpr Rule<Attached> kKhrAttachment[] = {
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexType-11570", Report, "indexType", wrongIndexType},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11573", Report, "indexStride",
     wrongIndexStride},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11574", Report, "indexStride",
     largeIndexStride},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11571", Report, "indexBuffer",
     unneededIndices},
    {kKhrIndicesId, Depends, "indexBuffer", noIndices},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-11579", Report, "micromap",
     [](const Attached &c) {
         return when(!c.indexed() && !c.attachment.micromap,
                     "it is VK_NULL_HANDLE, and indexType is VK_INDEX_TYPE_NONE_KHR");
     }},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter", Reject, "micromap", noMicromap},
    // The layer builds micromaps first, with a barrier.
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548", Tolerate, "micromap",
     [](const Attached &c) {
         return when(c.attachment.micromap && c.objects->built.contains(c.attachment.micromap.handle),
                     "it is built by the same command");
     }},
};
// The host builds no structures with micromaps of VK_KHR_opacity_micromap.
constexpr Rule<Attached> kHostAttachment[] = {
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-11705", Report, "micromap",
     [](const Attached &c) {
         return when(c.attachment.khr && c.attachment.micromap,
                     "it is not VK_NULL_HANDLE; the host builds no structures with micromaps");
     }},
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-10892", Report, "indexBuffer",
     [](const Attached &c) { return c.attachment.khr ? Found{} : unneededIndices(c); }},
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-11821", Report, "indexBuffer",
     [](const Attached &c) {
         return when(!c.attachment.khr && c.indexed() && !c.attachment.indexBuffer.hostAddress,
                     "it is null, although there is an indexType");
     }},
    {ids::kAttachedCounts, Report, "pUsageCounts", wrongHostCounts},
};

// ------------------------------------------------------------------------------------------ pNext chains

// A structure of micromaps, and the one structure that it extends.
enum class Extended { Build, Geometry, Triangles, Boxes, Instances };
struct Extending {
    VkStructureType type;
    Extended extended;
    bool EnabledFeatures::*enabled;
    const char *extension;
};
constexpr Extending kExtending[] = {
    {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT, Extended::Triangles,
     &EnabledFeatures::ext, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME},
    {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR, Extended::Triangles,
     &EnabledFeatures::khr, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME},
    {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR, Extended::Geometry, &EnabledFeatures::khr,
     VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME},
};

struct Chain {
    const void *first;
    const RuleDevice &device;
};
template <Extended extended>
Found misplaced(const Chain &c)
{
    const bool hasTriangles =
        extended == Extended::Triangles || (extended == Extended::Geometry && findInChain(c.first, kDenseTriangles));
    for (const auto *s = static_cast<const VkBaseInStructure *>(c.first); s; s = s->pNext) {
        const auto *found = std::ranges::find(kExtending, s->sType, &Extending::type);
        if (found == std::end(kExtending))
            continue;
        if (found->extended == Extended::Triangles ? !hasTriangles : found->extended != extended)
            return {nameOf(s->sType) + " is in the chain; it extends " +
                    (found->extended == Extended::Triangles ? "VkAccelerationStructureGeometryTrianglesDataKHR"
                                                            : "VkAccelerationStructureGeometryKHR")};
        if (!(c.device.driver.enabled.*found->enabled))
            return {nameOf(s->sType) + " is in the chain; " + found->extension + " is not enabled"};
    }
    return {};
}
// A structure of micromaps is in a chain once.
Found repeated(const Chain &c)
{
    for (const Extending &extending : kExtending) {
        uint32_t count = 0;
        for (const auto *s = static_cast<const VkBaseInStructure *>(c.first); s; s = s->pNext)
            count += s->sType == extending.type ? 1 : 0;
        if (count > 1)
            return {nameOf(extending.type) + " is in the chain " + std::to_string(count) + " times"};
    }
    return {};
}

constexpr Rule<Chain> kBuildChain[] = {
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-pNext-pNext", Report, "pNext", misplaced<Extended::Build>},
};
constexpr Rule<Chain> kGeometryChain[] = {
    {"VUID-VkAccelerationStructureGeometryKHR-pNext-pNext", Report, "pNext", misplaced<Extended::Geometry>},
    {"VUID-VkAccelerationStructureGeometryKHR-sType-unique", Report, "pNext", repeated},
};
constexpr Rule<Chain> kTrianglesChain[] = {
    {"VUID-VkAccelerationStructureGeometryTrianglesDataKHR-pNext-pNext", Report, "geometry.triangles.pNext",
     misplaced<Extended::Triangles>},
    {"VUID-VkAccelerationStructureGeometryTrianglesDataKHR-sType-unique", Report, "geometry.triangles.pNext", repeated},
};
constexpr Rule<Chain> kBoxesChain[] = {
    {"VUID-VkAccelerationStructureGeometryAabbsDataKHR-pNext-pNext", Report, "geometry.aabbs.pNext",
     misplaced<Extended::Boxes>},
};
constexpr Rule<Chain> kInstancesChain[] = {
    {"VUID-VkAccelerationStructureGeometryInstancesDataKHR-pNext-pNext", Report, "geometry.instances.pNext",
     misplaced<Extended::Instances>},
};

void checkChains(const InputCheck &check, const VkAccelerationStructureGeometryKHR &given)
{
    const auto checkChain = [&check](std::span<const Rule<Chain>> rules, const void *first) {
        check.check<Chain>(rules, {first, check.device()});
    };
    checkChain(kGeometryChain, given.pNext);
    switch (given.geometryType) {
    case VK_GEOMETRY_TYPE_TRIANGLES_KHR: checkChain(kTrianglesChain, given.geometry.triangles.pNext); break;
    case VK_GEOMETRY_TYPE_AABBS_KHR: checkChain(kBoxesChain, given.geometry.aabbs.pNext); break;
    case VK_GEOMETRY_TYPE_INSTANCES_KHR: checkChain(kInstancesChain, given.geometry.instances.pNext); break;
    default: break;
    }
}
// The chain of a geometry, which may be null.
void checkChains(const InputCheck &check, uint32_t g, const VkAccelerationStructureGeometryKHR *given)
{
    const Place place = check.place().element("pGeometries", g);
    if (given)
        checkChains(check.at(place), *given);
}
void checkChains(const InputCheck &check, const input::StructureBuild &build)
{
    if (!check.device().validating)
        return;
    check.check<Chain>(kBuildChain, {build.given->pNext, check.device()});
    for (uint32_t g = 0; g < build.geometries.size(); ++g)
        checkChains(check, g, build.geometries[g].given);
}
void checkChains(const InputCheck &check, const input::MicromapBuild &build)
{
    if (!check.device().validating)
        return;
    const auto *given = static_cast<const VkAccelerationStructureBuildGeometryInfoKHR *>(build.given);
    check.check<Chain>(kBuildChain, {given->pNext, check.device()});
    checkChains(check, 0, build.geometry);
}

// An attachment of VK_EXT_opacity_micromap. `rules`: of the command.
Verdict checkExtAttachment(const InputCheck &check, const Attached &c, std::span<const Rule<Attached>> rules)
{
    Verdict verdict = check.check<Attached>(kExtStructure, c);
    verdict &= check.check<Attached>(rules, c);
    if (c.attachment.micromap)
        verdict &=
            checkUsages(check, kAttachedUsages, c.attachment.usages, false, std::nullopt, check.device().extLimits);
    return verdict;
}

Verdict checkAttachment(const InputCheck &check, const Attached &c)
{
    if (c.attachment.khr)
        return check.check<Attached>(kKhrAttachment, c);
    // Only validation knows whether the micromap exists.
    return check.device().validating ? checkExtAttachment(check, c, kExtAttachment) : Verdict{};
}

Verdict checkHostAttachment(const InputCheck &check, const Attached &c)
{
    const bool ext = !c.attachment.khr && check.device().validating;
    return ext ? checkExtAttachment(check, c, kHostAttachment) : check.check<Attached>(kHostAttachment, c);
}

// Calls checkOne(check, attached) for each geometry with a micromap, until one is not accepted. `objects`: null on the
// host.
template <typename CheckOne>
Verdict checkAttachments(const InputCheck &check, const input::StructureBuild &build, const Objects *objects,
                         CheckOne checkOne)
{
    Verdict verdict;
    for (uint32_t g = 0; g < build.geometries.size() && (verdict.accepted || check.device().validating); ++g) {
        const auto &attachment = build.geometries[g].attachment;
        if (!attachment)
            continue;
        const Place element = check.place().element("pGeometries", g);
        const Place triangles = element.member("geometry.triangles");
        verdict &= checkOne(check.at(triangles), Attached{*attachment, check.device(), build.ranges, g, objects});
    }
    return verdict;
}

// ------------------------------------------------------------------------------------------ queries of sizes

struct Sizes {
    bool micromap;
    VkAccelerationStructureBuildTypeKHR type;
    bool hasCounts, hasGeometries;
};
constexpr Rule<Sizes> kSizes[] = {
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11612", Report, "pMaxPrimitiveCounts",
     [](const Sizes &c) {
         return when(!c.micromap && !c.hasCounts && c.hasGeometries, "it is null, and the structure is not a micromap");
     }},
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-buildType-11614", Report, "buildType",
     [](const Sizes &c) {
         return when(c.micromap && c.type != VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                     "micromaps are built on the device only");
     }},
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11613", Report, "pMaxPrimitiveCounts",
     [](const Sizes &c) { return when(c.micromap && c.hasCounts, "it is not null, and the structure is a micromap"); }},
};

Verdict checkFlags(const InputCheck &check, VkFlags flags, bool micromap)
{
    return check.check<Flags>(kFlags, {flags, micromap, check.device().driver.enabled});
}

// Checks the kind of a build and its usage counts. Sets `countsKept` if its sizes can be queried.
Verdict checkInfo(const InputCheck &check, const Build &c, bool &countsKept)
{
    Verdict verdict = check.check<Build>(c.build.khr ? std::span<const Rule<Build>>(kKhrInfo) : kExtInfo, c);
    if (c.build.khr)
        checkChains(check, c.build);
    if (c.build.khr && (verdict.accepted || check.device().validating))
        verdict &= checkFlags(check, c.build.flags, true);
    countsKept = false;
    if ((c.build.khr && !c.build.hasData) || (!verdict.accepted && !check.device().validating))
        return verdict;
    const Verdict counts = checkCounts(check, c);
    countsKept = counts.kept || (counts.accepted && c.support());
    verdict &= counts;
    return verdict;
}

Verdict findNeeds(const InputCheck &check, input::MicromapBuild &build)
{
    const RuleDevice &device = check.device();
    const auto needs = device.needs ? device.needs(build) : std::nullopt;
    build.needs = needs.value_or(input::BuildNeeds{});
    if (needs || !device.support(build.khr))
        return {};
    return check.report("VELLUM-micromap-too-large", "pUsageCounts",
                        "they add up to more than 2^32 triangles or data units");
}

void checkBuild(const InputCheck &check, input::MicromapBuild &build, const ObjectFacts &target)
{
    const Build c{build, check.device(), target};
    bool countsKept = false;
    Verdict verdict = checkInfo(check, c, countsKept);
    const auto goesOn = [&] { return verdict.accepted || check.device().validating; };
    if (goesOn())
        verdict &= check.check<Build>(build.khr    ? std::span<const Rule<Build>>(kKhrBuild)
                                      : build.host ? std::span<const Rule<Build>>(kExtHostBuild)
                                                   : kExtBuild,
                                      c);
    if (countsKept && target.exists && target.canHoldMicromap() && goesOn())
        verdict &= findNeeds(check, build);
    if (build.needs.micromap > 0 && goesOn())
        verdict &= check.check<Build>(build.khr    ? std::span<const Rule<Build>>(kKhrMemory)
                                      : build.host ? std::span<const Rule<Build>>(kExtHostMemory)
                                                   : kExtMemory,
                                      c);
    build.accepted = verdict.accepted;
}

void checkBuild(const InputCheck &check, input::StructureBuild &build, const Objects &objects)
{
    Structure c{build, check.device(), objects.facts(build.given->dstAccelerationStructure)};
    if (build.isUpdate())
        c.source = objects.facts(build.given->srcAccelerationStructure);
    Verdict verdict = checkFlags(check, build.given->flags, false);
    const auto goesOn = [&] { return verdict.accepted || check.device().validating; };
    verdict &= check.check<Structure>(kGeometries, c);
    checkChains(check, build);
    if (goesOn())
        verdict &= check.check<Structure>(kStructure, c);
    if (goesOn())
        verdict &= checkAttachments(check, build, &objects, checkAttachment);
    build.accepted = verdict.accepted;
}

} // namespace

std::string tooFewBytes(VkDeviceSize available, VkDeviceSize needed)
{
    return "its buffer has " + std::to_string(available) + " bytes from there; the build needs " +
           std::to_string(needed);
}

void checkBuilds(const RuleDevice &device, const Place &command, input::Builds &builds, const Facts &facts)
{
    const bool allowed = builds.command != input::BuildCommand::HostMicromaps ||
                         InputCheck(device, command).check<RuleDevice>(kHostBuilds, device).accepted;
    std::unordered_set<uint64_t> built;
    for (input::MicromapBuild &build : builds.micromaps) {
        const Place place = command.element("pInfos", build.element);
        checkBuild(InputCheck(device, place, build.target), build, facts(build.target));
        build.accepted = build.accepted && allowed;
        if (!builds.structures.empty())
            built.insert(build.target.handle);
    }
    for (input::StructureBuild &build : builds.structures) {
        const Place place = command.element("pInfos", build.element);
        checkBuild(InputCheck(device, place, build.given->dstAccelerationStructure), build, {facts, built});
    }
}

void checkHostBuilds(const RuleDevice &device, const Place &command, input::Builds &builds)
{
    for (input::StructureBuild &build : builds.structures) {
        const Place place = command.element("pInfos", build.element);
        const InputCheck check(device, place, build.given->dstAccelerationStructure);
        Verdict verdict = check.check<Structure>(kGeometries, {build, device});
        checkChains(check, build);
        verdict &= checkAttachments(check, build, nullptr, checkHostAttachment);
        build.accepted = verdict.accepted;
    }
}

void checkSizes(const RuleDevice &device, const Place &command, input::Builds &query)
{
    const Place place = command.member("pBuildInfo");
    const InputCheck check(device, place);
    for (input::MicromapBuild &build : query.micromaps) {
        bool countsKept = false;
        const ObjectFacts none;
        const Build c{build, device, none};
        Verdict verdict = checkInfo(check, c, countsKept);
        if (verdict.accepted && c.support())
            verdict &= findNeeds(check, build);
        build.accepted = verdict.accepted;
    }
    for (input::StructureBuild &build : query.structures) {
        Verdict verdict = checkFlags(check, build.given->flags, false);
        verdict &= check.check<Structure>(kGeometries, {build, device});
        checkChains(check, build);
        build.accepted = verdict.accepted;
    }
}

void checkSizeParameters(const RuleDevice &device, const Place &command, const input::Builds &query,
                         VkAccelerationStructureBuildTypeKHR type, bool hasCounts)
{
    const bool hasGeometries = !query.structures.empty() && !query.structures[0].geometries.empty();
    InputCheck(device, command).check<Sizes>(kSizes, {!query.micromaps.empty(), type, hasCounts, hasGeometries});
}

} // namespace vellum::layer::rules
