// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/gpu/gpu_log.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/rules/ids.h"
#include "layer/validation/gpu/gpu_checks.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

struct BrokenRule {
    const char *vuid;
    std::string text;
};

std::string number(uint32_t value)
{
    return std::to_string(value);
}

input::BuildCommand commandOf(const Finding &f)
{
    return static_cast<input::BuildCommand>(f.site >> kSiteCommandShift);
}

std::string kindOf(uint32_t levelAndFormat)
{
    return (levelAndFormat >> 16) == 1 ? "2-state" : "4-state";
}

// An index into a micromap, with a hint if the program seems to mean a special one: -1 to -4, or the -5 of clusters.
std::string indexText(uint32_t index)
{
    const bool seemsSpecial =
        index >= 0xfffffff0 || (index >= 0xfff0 && index <= 0xffff) || (index >= 0xfb && index <= 0xff);
    if (!seemsSpecial)
        return "index " + number(index);
    char text[24];
    std::snprintf(text, sizeof text, "index 0x%" PRIx32, index);
    return text + std::string(" (special indices are 0xfffffffc to 0xffffffff, in shorter index types 0xfffc to 0xffff "
                              "and 0xfc to 0xff; that of clusters is not for triangles)");
}

BrokenRule levelRule(const GpuChecks &gpu, bool khr, uint32_t levelAndFormat)
{
    const bool two = (levelAndFormat >> 16) == 1;
    const MicromapLimits &limits = gpu.device.rules.limits(khr);
    const uint32_t limit = two ? limits.twoStateLevel : limits.fourStateLevel;
    const char *vuid = two   ? (khr ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11556"
                                    : "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11659")
                       : khr ? "VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11566"
                             : "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11660";
    return {vuid, "subdivision level " + number(levelAndFormat & 0xffff) + " is above " + number(limit) +
                      ", the limit of the " + kindOf(levelAndFormat) + " format"};
}

// The findings about the input of a micromap build.
BrokenRule micromapRule(const GpuChecks &gpu, const Finding &f, bool khr)
{
    const std::string level = number(f.value1 & 0xffff);
    switch (f.what & kFindingMask) {
    case kFindingFormat:
        return {khr ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11555"
                    : "VUID-VkMicromapBuildInfoEXT-format-11657",
                "format " + number(f.value1 >> 16) + " is neither 2-state nor 4-state"};
    case kFindingLevel: return levelRule(gpu, khr, f.value1);
    case kFindingLossyLevel:
        return {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11567",
                "subdivision level " + level + " is above " + number(gpu.device.rules.khrLimits.lossyLevel) +
                    ", the limit of lossy builds"};
    case kFindingLossyFormat:
        return {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11713",
                "its format is 2-state; that of lossy builds is 4-state"};
    case kFindingUndeclared:
        return {"VELLUM-micromap-usage-counts", "subdivision level " + level + " is not in the usage counts"};
    default:
        return {khr ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11553" : "VELLUM-micromap-data",
                "its data of " + number(triangleBytes(f.value1 & 0xffff, f.value1 >> 16)) + " bytes at offset " +
                    number(f.value0) + " end outside the buffer of data"};
    }
}

BrokenRule countsRule(const Finding &f)
{
    return {"VELLUM-micromap-usage-counts", "the usage counts state " + number(f.value0) + " " + kindOf(f.element) +
                                                " triangles of level " + number(f.element & 0xffff) +
                                                ", the triangle array has " + number(f.value1)};
}

BrokenRule attachedCountsRule(const Finding &f)
{
    return {rules::ids::kAttachedCounts, "the usage counts state " + number(f.value0) + " triangles; " +
                                             number(f.value1) + " of the geometry have an index into the micromap"};
}

// The findings about the triangles of a geometry with a micromap.
BrokenRule geometryRule(const Finding &f, bool khr, const std::string &micromap)
{
    const auto rule = [khr](const char *vuid) { return khr ? vuid : "VELLUM-micromap-index"; };
    const char *const empty = f.value1 == 0 ? ", which was built with usage counts that sum to 0" : "";
    const std::string rest = " is outside the " + number(f.value1) + " triangles of micromap " + micromap + empty;
    switch (f.what & kFindingMask) {
    case kFindingIndex:
        return {rule("VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575"),
                indexText(f.value0) + " plus baseTriangle" + rest};
    case kFindingNumber:
        return {rule("VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-geometry-11576"),
                "its number plus baseTriangle" + rest};
    case kFindingNotSpecial:
        return {rule("VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11578"),
                indexText(f.value0) + " is not special, but there is no micromap"};
    default:
        return {rule("VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577"),
                "its index is outside the buffer of indexBuffer, like those after it; the geometry has " +
                    number(f.value0) + " triangles"};
    }
}

BrokenRule instanceRule(GpuChecks &gpu, const Finding &f)
{
    if ((f.what & kFindingMask) == kFindingFeature)
        return {"VUID-VkAccelerationStructureInstanceKHR-micromap-11580",
                "flags has bits of micromaps, whose feature is not enabled"};
    const std::string address = hex(uint64_t{f.value1} << 32 | f.value0);
    if ((f.what & kFindingMask) == kFindingPointer)
        return {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03717",
                "the pointer to it, " + address + ", is not a multiple of 16"};
    const char *what = nullptr;
    switch (f.what & kFindingMask) {
    case kFindingMicromap: what = " is a micromap"; break;
    case kFindingTopLevel: what = " is a top-level structure"; break;
    case kFindingNoStructure: what = " does not exist"; break;
    case kFindingDestroyed: what = " was destroyed, or lost its memory"; break;
    default: break;
    }
    if (what) {
        const bool indirect = commandOf(f) == input::BuildCommand::IndirectStructures;
        gpu.pending.found(1u << (indirect ? kGpuErrorNoBottomLevelIndirect : kGpuErrorNoBottomLevel));
        return {rules::ids::kReference, "the structure at accelerationStructureReference " + address + what};
    }
    return {gpu.device.driver.enabled.khr ? "VUID-VkAccelerationStructureInstanceKHR-flags-11581"
                                          : "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10607",
            std::string("flags has DISABLE_OPACITY_MICROMAPS, but the structure at ") + address +
                " was built without ALLOW_DISABLE_OPACITY_MICROMAPS"};
}

std::string placeOf(const Finding &f)
{
    std::string place = nameOf(commandOf(f));
    place += ": pInfos[" + number(f.site & kSiteInfoMask) + "]";
    if (f.geometry != kNoGeometry)
        place += ".pGeometries[" + number(f.geometry) + "]";
    return place;
}

} // namespace

void reportFinding(GpuChecks &gpu, const Finding &f)
{
    const bool khr = (f.what & kFindingKhr) != 0;
    const ObjectHandle object((f.what & kFindingStructure) != 0 ? VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR
                                                                : VK_OBJECT_TYPE_MICROMAP_EXT,
                              f.object);
    const std::string triangle = "triangle " + number(f.element) + ": ";
    const uint32_t what = f.what & kFindingMask;
    BrokenRule rule;
    if (what == kFindingCounts) {
        rule = countsRule(f);
    } else if (what == kFindingAttachedCounts) {
        rule = attachedCountsRule(f);
    } else if (what < kFindingCounts) {
        rule = micromapRule(gpu, f, khr);
        rule.text = triangle + rule.text;
    } else if (what < kFindingDisable) {
        rule = geometryRule(f, khr, gpu.device.nameOf(object));
        rule.text = triangle + rule.text;
    } else {
        rule = instanceRule(gpu, f);
        rule.text = "instance " + number(f.element) + ": " + rule.text;
    }
    gpu.device.at(Place(placeOf(f)), object).report(rule.vuid, nullptr, rule.text);
}

VkResult GpuLog::create(const GpuContext &context)
{
    return log_.create(context, (kLogHeaderWords + kLogCapacity * kLogEntryWords) * 4);
}

bool GpuLog::hasNew() const
{
    const uint32_t *words = log_.words();
    return words && __atomic_load_n(words + kLogCount, __ATOMIC_ACQUIRE) != seen_.load(std::memory_order_relaxed);
}

std::optional<Finding> GpuLog::take()
{
    std::lock_guard lock(mutex_);
    const uint32_t *words = log_.words();
    const uint32_t logged = __atomic_load_n(words + kLogCount, __ATOMIC_ACQUIRE);
    if (reported_ == std::min(logged, kLogCapacity)) {
        seen_.store(logged, std::memory_order_relaxed);
        return std::nullopt;
    }
    const uint32_t *at = words + kLogHeaderWords + reported_ * kLogEntryWords;
    if (__atomic_load_n(at, __ATOMIC_ACQUIRE) == 0)
        return std::nullopt; // still being written
    Finding finding;
    static_assert(sizeof finding == kLogEntryWords * 4);
    std::memcpy(&finding, at, sizeof finding);
    ++reported_;
    return finding;
}

void GpuLog::drain(GpuChecks &gpu)
{
    if (!hasNew())
        return;
    while (const auto finding = take())
        reportFinding(gpu, *finding);
    bool overflows = false;
    {
        std::lock_guard lock(mutex_);
        overflows = seen_.load(std::memory_order_relaxed) > kLogCapacity && !reportedOverflow_;
        reportedOverflow_ |= overflows;
    }
    if (overflows)
        gpu.device.driver.report().error("VELLUM-validation-log",
                                         "there are more findings than the " + std::to_string(kLogCapacity) +
                                             " reported; further ones are reported after vkDeviceWaitIdle");
}

void GpuLog::drainIdle(GpuChecks &gpu)
{
    drain(gpu);
    std::lock_guard lock(mutex_);
    if (reported_ == 0)
        return;
    std::memset(log_.words(), 0, (kLogHeaderWords + reported_ * kLogEntryWords) * 4);
    reported_ = 0;
    seen_.store(0, std::memory_order_relaxed);
    reportedOverflow_ = false;
}

} // namespace vellum::layer
