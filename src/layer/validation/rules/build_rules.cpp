// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/build_rules.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <span>
#include <utility>

#include "layer/base/setting_names.h"
#include "layer/input/checked.h"
#include "layer/rules/builds.h"
#include "layer/rules/ids.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

using input::BuildCommand;

namespace
{

// --- Memory of the builds of one command ---

// The memory that one build writes.
struct BuildMemory {
    uint32_t element = 0;
    ObjectHandle target;
    MemoryRange targetRange;
    MemoryRange scratchRange;
};
// Rules for the memory of several builds by one command.
struct OverlapIds {
    const char *sameTarget; // null: as targets
    const char *targets;
    const char *targetAndScratch;
    const char *scratches;
};
constexpr OverlapIds kMicromaps{nullptr, "VUID-vkCmdBuildMicromapsEXT-dstMicromap-11649",
                                "VUID-vkCmdBuildMicromapsEXT-dstMicromap-11650",
                                "VUID-vkCmdBuildMicromapsEXT-scratchData-11651"};
constexpr OverlapIds kHostMicromaps{nullptr, "VUID-vkBuildMicromapsEXT-dstMicromap-11667", nullptr, nullptr};
constexpr OverlapIds kStructures{"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03698",
                                 "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03702",
                                 "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703",
                                 "VUID-vkCmdBuildAccelerationStructuresKHR-scratchData-03704"};

BuildMemory memoryOf(const DeviceModel &device, const input::MicromapBuild &build)
{
    // A build with another mistake has no known needs. Scratch memory of the host is not in a buffer.
    if (build.needs.micromap == 0)
        return {build.element, build.target, {}, {}};
    return {build.element, build.target, memoryOf(device.objects.structureOf(build.target).get(), build.needs.micromap),
            build.host ? MemoryRange{} : memoryAt(device, build.scratch.deviceAddress, build.needs.scratch)};
}

// The sizes that a build of another structure needs, by a query. Of an indirect build, whose counts only the device
// knows, those without primitives: it accesses at least that memory.
VkAccelerationStructureBuildSizesInfoKHR sizesOf(const DeviceModel &device, const input::StructureBuild &build)
{
    std::vector<uint32_t> counts;
    for (uint32_t g = 0; g < build.geometries.size(); ++g)
        counts.push_back(build.ranges.direct ? build.ranges.primitives(g) : 0);
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    input::Builds query;
    query.structures.push_back(build);
    const input::Checked checked(build.given, query); // the implementation neither parses nor checks it again
    device.next.GetAccelerationStructureBuildSizesKHR(
        device.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, build.given, counts.data(), &sizes);
    return sizes;
}

// For the target of an update, which may be compacted, only the first byte.
BuildMemory memoryOf(const DeviceModel &device, const input::StructureBuild &build, VkDeviceSize size,
                     VkDeviceSize scratch)
{
    const ObjectHandle target = build.given->dstAccelerationStructure;
    return {build.element, target, memoryOf(device.objects.structureOf(target).get(), build.isUpdate() ? 1 : size),
            memoryAt(device, build.given->scratchData.deviceAddress, scratch)};
}

std::pair<uint64_t, uint64_t> placeOf(const MemoryRange &range)
{
    return {range.memory, range.begin};
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
    std::ranges::sort(pieces, {}, [](const Piece &piece) { return std::pair(placeOf(piece.range), piece.build); });
    const auto reportOverlap = [&](const Piece &a, const Piece &b) {
        const Piece &one = a.build > b.build ? a : b;
        const Piece &other = a.build > b.build ? b : a;
        const bool bothTargets = !one.scratch && !other.scratch;
        const bool same = bothTargets && builds[one.build].target.handle == builds[other.build].target.handle;
        const char *id = same && ids.sameTarget         ? ids.sameTarget
                         : bothTargets                  ? ids.targets
                         : one.scratch && other.scratch ? ids.scratches
                                                        : ids.targetAndScratch;
        const Place place = command.place().element("pInfos", builds[one.build].element);
        command.at(place).report(id, nullptr,
                                 std::string(one.scratch ? "scratchData" : "the target") + " overlaps in memory " +
                                     (other.scratch ? "scratchData" : "the target") + " of pInfos[" +
                                     std::to_string(builds[other.build].element) + "]");
    };
    // Two reports for each piece at most: all builds of a wrong program may share their scratch memory.
    std::array<const Piece *, 2> furthest{}; // of the targets and of the scratch memory before, what ends last
    for (const Piece &piece : pieces) {
        for (const Piece *other : furthest)
            if (other && piece.range.overlaps(other->range))
                reportOverlap(*other, piece);
        const Piece *&own = furthest[piece.scratch ? 1 : 0];
        if (!own || !piece.range.overlaps(own->range) || piece.range.end > own->range.end)
            own = &piece;
    }
}

// Micromaps that geometries attach, against the targets of the other builds. `targets`: in the order of memory.
void checkAttachedMemory(const RuleCheck &command, const input::StructureBuild &build,
                         std::span<const BuildMemory> targets)
{
    for (uint32_t g = 0; g < build.geometries.size(); ++g) {
        const auto &attachment = build.geometries[g].attachment;
        if (!attachment || !attachment->khr || !attachment->micromap)
            continue;
        const MemoryRange memory = memoryOf(command.model().objects.structureOf(attachment->micromap).get(), 1);
        const auto after = std::ranges::upper_bound(
            targets, placeOf(memory), {}, [](const BuildMemory &other) { return placeOf(other.targetRange); });
        if (after == targets.begin())
            continue;
        const BuildMemory &other = *std::prev(after);
        const bool same = other.target.handle == attachment->micromap.handle; // another rule
        if (other.element == build.element || same || !memory.overlaps(other.targetRange))
            continue;
        const Place place = command.place().element("pInfos", other.element);
        command.at(place).report("VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11549",
                                 "dstAccelerationStructure",
                                 "it overlaps in memory the micromap of pInfos[" + std::to_string(build.element) +
                                     "].pGeometries[" + std::to_string(g) + "]");
    }
}

// --- Addresses, and the objects that are built ---

using Of = input::Access::Of;

// The member that states an address, and the rule that it is valid.
struct AddressMember {
    const char *name;
    const char *vuid;
};
AddressMember memberOf(const input::MicromapBuild &build, const input::Access &access)
{
    switch (access.of) {
    case Of::Data: return {"data", build.khr ? rules::kKhrInputId : rules::kExtDataId};
    case Of::TriangleArray: return {"triangleArray", build.khr ? rules::kKhrInputId : rules::kExtTrianglesId};
    default: return {"scratchData", build.khr ? rules::kScratchId : rules::kExtScratchId};
    }
}
AddressMember memberOf(const input::StructureBuild &build, const input::Access &access)
{
    switch (access.of) {
    case Of::Vertices:
        return {"geometry.triangles.vertexData", "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03804"};
    case Of::Indices: return {"geometry.triangles.indexData", "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03806"};
    case Of::Transform:
        return {"geometry.triangles.transformData", "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03808"};
    case Of::Boxes: return {"geometry.aabbs.data", "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03811"};
    case Of::Instances: return {"geometry.instances.data", "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03813"};
    case Of::MicromapIndices:
        return {"geometry.triangles.indexBuffer",
                build.geometries[access.geometry].attachment->khr ? rules::kKhrIndicesId : rules::kExtIndicesId};
    default:
        return {"scratchData",
                build.isUpdate() ? "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12260" : rules::kScratchId};
    }
}

// The buffers that are accessed exist when the command is executed.
template <typename Build>
void checkWhenExecuted(const RuleCheck &check, const Build &build)
{
    DeviceModel &device = check.model();
    for (const input::Access &access : build.accesses)
        if (const AddressMember member = memberOf(build, access); !device.rules.lacksBuffer(access.address))
            layer::checkWhenExecuted(device, check.commandBuffer(),
                                     {.address = access.address,
                                      .command = check.place().command(),
                                      .info = build.element,
                                      .geometry = access.geometry,
                                      .member = member.name,
                                      .vuid = member.vuid,
                                      .object = check.object()});
}

void checkInstanceAlignment(const InputCheck &check, const input::StructureBuild &build)
{
    for (const input::Geometry &geometry : build.geometries) {
        if (!geometry.isInstances())
            continue;
        const auto &instances = geometry.given->geometry.instances;
        const bool pointers = instances.arrayOfPointers != VK_FALSE;
        const VkDeviceAddress alignment = pointers ? 8 : 16;
        if (instances.data.deviceAddress % alignment != 0)
            check.report(pointers ? "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03716"
                                  : "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03715",
                         "pGeometries[0].geometry.instances.data",
                         hex(instances.data.deviceAddress) + " is not a multiple of " + std::to_string(alignment));
    }
}

// Checks the addresses of the data of geometries. Returns whether the build can be recorded.
bool checkAddresses(const RuleCheck &check, const input::StructureBuild &build)
{
    const RuleDevice &rules = check.model().rules;
    bool valid = true;
    for (const input::Access &access : build.accesses) {
        if (access.of == Of::MicromapIndices)
            continue; // rules of the input
        const AddressMember member = memberOf(build, access);
        const Place geometry = check.place().element("pGeometries", access.geometry);
        const InputCheck part = check.InputCheck::at(geometry);
        if (const Found found = isInvalid(rules, access.address, Severity::Reject)) {
            part.report(member.vuid, member.name, found.text);
            valid = false;
        } else if (lacksUsage(rules, access.address,
                              VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR)) {
            part.report("VUID-vkCmdBuildAccelerationStructuresKHR-geometry-03673", member.name,
                        "its buffer was created without ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY");
        }
    }
    checkInstanceAlignment(check, build);
    return valid;
}

// Checks the scratch memory of a build with these sizes. Returns whether it can be recorded.
bool checkScratch(const RuleCheck &check, const input::StructureBuild &build, VkDeviceSize needed)
{
    const DeviceModel &model = check.model();
    const VkDeviceAddress address = build.given->scratchData.deviceAddress;
    if (needed == 0)
        return true; // the address is not used, and may be any
    const auto [name, vuid] = memberOf(build, {Of::Scratch, address, 0, needed, input::Access::kNone});
    if (const Found found = isInvalid(model.rules, address, Severity::Reject)) {
        check.report(vuid, name, found.text);
        return false;
    }
    if (lacksUsage(model.rules, address, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT))
        check.report(vuid, name, "its buffer was created without VK_BUFFER_USAGE_STORAGE_BUFFER_BIT");
    const VkDeviceSize available = model.buffers.addresses.bytesFrom(address);
    if (build.ranges.direct && available < needed)
        check.report(build.isUpdate() ? "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12259" : rules::kScratchSizeId,
                     name, rules::tooFewBytes(available, needed));
    return true;
}

// --- What attached micromaps hold ---

// A structure of VK_KHR_opacity_micromap may hold something that is not a micromap.
void checkIsMicromap(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &micromap)
{
    constexpr const char *kId = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11624";
    check.whenExecuted(kId, [&device = check.model(), micromap]() -> std::string {
        const auto contents = micromap->contents;
        if (!contents || contents->deserialized ||
            contents->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
            return {};
        return "the structure " + device.nameOf(micromap->handle) + " was not built as a micromap";
    });
}

// The usage counts of a geometry are of kinds that the micromap has; layer/rules and the check `gpu` add them up.
void checkUsages(const RuleCheck &check, const input::Attachment &attachment,
                 const std::shared_ptr<ValidatedStructure> &micromap)
{
    if (attachment.khr || attachment.usages.size() == 0)
        return;
    check.whenExecuted(rules::ids::kAttachedCounts, [micromap, usages = attachment.usages.merged()]() -> std::string {
        const auto contents = micromap->contents;
        if (!contents || contents->deserialized)
            return {};
        for (const VkMicromapUsageEXT &usage : usages)
            if (usage.count > 0 && trianglesOf(contents->usages, usage.subdivisionLevel, usage.format) == 0)
                return "the usage counts state triangles of level " + std::to_string(usage.subdivisionLevel) +
                       " and format " + nameOfFormat(usage.format) + "; the micromap has none";
        return {};
    });
}

// An index stride of 0 is valid; an application that leaves it at 0 by mistake gets micromaps all the same.
void warnOfStride(const RuleCheck &check, const input::Attachment &attachment, uint32_t triangles)
{
    if (attachment.indexType == VK_INDEX_TYPE_NONE_KHR || attachment.indexStride != 0 ||
        attachment.indexBuffer.deviceAddress == 0 || triangles < 2)
        return;
    const ObjectHandle object = check.object();
    check.model().driver.report().warning("VELLUM-attachment-index-stride",
                                          check.place().text() + ".indexStride: it is 0, so that all " +
                                              std::to_string(triangles) + " triangles have the first index",
                                          object.type, object.handle);
}

void checkAttachments(const RuleCheck &check, const input::StructureBuild &build)
{
    for (uint32_t g = 0; g < build.geometries.size(); ++g) {
        const auto &attachment = build.geometries[g].attachment;
        if (!attachment)
            continue;
        const Place element = check.place().element("pGeometries", g);
        const Place place = element.member("geometry.triangles");
        if (build.ranges.direct)
            warnOfStride(check.at(place), *attachment, build.ranges.primitives(g));
        const auto micromap = check.model().objects.structureOf(attachment->micromap);
        if (!micromap)
            continue;
        checkConstructed(check.at(place), micromap,
                         attachment->khr ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11701"
                                         : "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11632");
        checkUsages(check.at(place), *attachment, micromap);
        if (attachment->khr)
            checkIsMicromap(check.at(place), micromap);
    }
}

// --- Updates ---

constexpr VkFlags kReplaces = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR;
constexpr VkFlags kReplacesData = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;

// What an update sets on a geometry of triangles.
struct UpdatedGeometry {
    bool attaches = false;
    bool khr = false;
    std::shared_ptr<ValidatedStructure> micromap;
    ObjectHandle handle;
    std::vector<VkMicromapUsageEXT> usages;
};

constexpr const char *kLosesMicromap = "the geometry was built with a micromap; the update has none";
constexpr const char *kOtherMicromap =
    "the update attaches another micromap, which the flags of the build do not allow";

using Usages = std::vector<VkMicromapUsageEXT>;

// An update of data changes opacities only: as many triangles of the geometry have each level and format as before. The
// micromap may have others.
std::string changedKinds(const Usages &before, const Usages &now)
{
    for (const Usages *usages : {&before, &now})
        for (const VkMicromapUsageEXT &usage : *usages) {
            const uint64_t had = trianglesOf(before, usage.subdivisionLevel, usage.format);
            const uint64_t has = trianglesOf(now, usage.subdivisionLevel, usage.format);
            if (had != has)
                return "the usage counts state " + std::to_string(has) + " triangles of level " +
                       std::to_string(usage.subdivisionLevel) + " and format " + nameOfFormat(usage.format) +
                       ", those of the build " + std::to_string(had) + "; its flags allow other opacities only";
        }
    return {};
}

// The fault of an update of a geometry that has, or had, a micromap of VK_EXT_opacity_micromap: it changes what the
// flags of the build do not allow. The specification has these rules in its text alone ("Acceleration Structure Update
// Rules").
std::string wrongExtUpdate(const GeometryContents &before, const UpdatedGeometry &now, VkFlags flags)
{
    if (!now.attaches)
        return kLosesMicromap;
    if ((flags & kReplaces) != 0)
        return {};
    if (!before.hasMicromap)
        return "the geometry was built without a micromap; the update attaches one, which the flags of the build do "
               "not allow";
    const bool other = before.micromap.lock() != now.micromap;
    if ((before.micromapHandle.handle == 0) != (now.handle.handle == 0) || (other && (flags & kReplacesData) == 0))
        return kOtherMicromap;
    return (flags & kReplacesData) != 0 ? changedKinds(before.usages, now.usages) : std::string();
}

// The rule that an update of a geometry breaks, and what is wrong; null if it breaks none.
const char *brokenBy(const GeometryContents &before, const UpdatedGeometry &now, VkFlags flags, std::string &text)
{
    const bool wasExt = before.hasMicromap && !before.khr, isExt = now.attaches && !now.khr;
    if (wasExt ? !now.khr : isExt && !before.hasMicromap) {
        text = wrongExtUpdate(before, now, flags);
        return text.empty() ? nullptr : "VELLUM-attachment-update";
    }
    if (wasExt || isExt)
        return nullptr;
    if (!before.hasMicromap) {
        text = "the geometry was built without a micromap; the update attaches one";
        return now.attaches ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11627" : nullptr;
    }
    if (before.micromapHandle.handle == 0) {
        text = "the geometry was built with VK_NULL_HANDLE as its micromap; the update differs";
        return !now.attaches || now.handle.handle != 0 ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11626"
                                                       : nullptr;
    }
    text = kLosesMicromap;
    if (!now.attaches || now.handle.handle == 0)
        return "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11625";
    text = kOtherMicromap;
    const bool replaces = (flags & (kReplaces | kReplacesData)) != 0;
    return !replaces && before.micromap.lock() != now.micromap
               ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11629"
               : nullptr;
}

void checkGeometryUpdate(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source, uint32_t g,
                         const UpdatedGeometry &now)
{
    check.whenExecuted([&device = check.model(), place = check.place().text(), source, g, now] {
        const auto contents = source->contents;
        if (!contents || contents->deserialized || g >= contents->geometries.size())
            return;
        std::string text;
        if (const char *vuid = brokenBy(contents->geometries[g], now, contents->flags, text))
            device.at(Place(place), source->handle).report(vuid, nullptr, text);
    });
}

constexpr const char *kAllowsUpdateId = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03667";

// An update has the flags and numbers of the build that it changes.
struct SameBuild {
    VkFlags flags;
    std::vector<std::optional<uint32_t>> primitives; // of each geometry; nothing in an indirect build

    // Calls report(id, text) for what differs.
    template <typename Report>
    void compare(const StructureContents &before, Report report) const
    {
        if ((before.flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR) == 0)
            report(kAllowsUpdateId, "srcAccelerationStructure was built without ALLOW_UPDATE");
        else if (flags != before.flags)
            report("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03759",
                   "flags is " + hex(flags) + "; srcAccelerationStructure was built with " + hex(before.flags));
        if (primitives.size() != before.geometries.size())
            return report("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03758",
                          "geometryCount is " + std::to_string(primitives.size()) +
                              "; srcAccelerationStructure was built with " + std::to_string(before.geometries.size()));
        for (size_t g = 0; g < primitives.size(); ++g) {
            const auto &had = before.geometries[g].primitives;
            if (had && primitives[g] && *had != *primitives[g])
                report("VUID-vkCmdBuildAccelerationStructuresKHR-primitiveCount-03769",
                       "primitiveCount of geometry " + std::to_string(g) + " is " + std::to_string(*primitives[g]) +
                           "; srcAccelerationStructure was built with " + std::to_string(*had));
        }
    }
};

void checkSameBuild(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
                    const input::StructureBuild &build)
{
    SameBuild now{build.given->flags, {}};
    for (uint32_t g = 0; g < build.geometries.size(); ++g)
        now.primitives.push_back(build.ranges.direct ? std::optional(build.ranges.primitives(g)) : std::nullopt);
    check.whenExecuted([&device = check.model(), place = check.place().text(), source, now = std::move(now)] {
        const auto contents = source->contents;
        const std::string why = contents ? std::string() : isNotConstructed(device, *source);
        if (!why.empty())
            device.at(Place(place), source->handle)
                .report(kAllowsUpdateId, nullptr, "srcAccelerationStructure is not constructed: " + why);
        if (contents && !contents->deserialized)
            now.compare(*contents, [&](const char *vuid, const std::string &text) {
                device.at(Place(place), source->handle).report(vuid, nullptr, text);
            });
    });
}

// An update, against what the source holds when the command is executed.
void checkUpdate(const RuleCheck &check, const input::StructureBuild &build)
{
    const auto source = check.model().objects.structureOf(build.given->srcAccelerationStructure);
    if (!build.isUpdate() || !source)
        return;
    checkSameBuild(check, source, build);
    for (uint32_t g = 0; g < build.geometries.size(); ++g) {
        const input::Geometry &geometry = build.geometries[g];
        if (!geometry.isTriangles())
            continue;
        UpdatedGeometry now;
        if (geometry.attachment)
            now = {true, geometry.attachment->khr, check.model().objects.structureOf(geometry.attachment->micromap),
                   geometry.attachment->micromap, geometry.attachment->usages.merged()};
        const Place place = check.place().element("pGeometries", g);
        checkGeometryUpdate(check.at(place), source, g, now);
    }
}

} // namespace

void noteChecked(DeviceModel &device, const input::Builds &builds)
{
    if ((!builds.micromaps.empty() || !builds.structures.empty()) && !device.hasCheckedBuild &&
        !device.hasCheckedBuild.exchange(true))
        device.driver.report().info("VELLUM-checked", "builds on this device are checked: " + namesOf(device.checks));
}

void checkBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, input::Builds &builds)
{
    noteChecked(device, builds);
    const Place place(nameOf(builds.command));
    rules::checkBuilds(device.rules, place, builds, [&device](ObjectHandle handle) { return device.factsOf(handle); });
    const bool core = device.checks.core;
    const bool ext = builds.command == BuildCommand::Micromaps, host = builds.command == BuildCommand::HostMicromaps;
    if (core && ext)
        checkFeature(device.at(place, commandBuffer), "VUID-vkCmdBuildMicromapsEXT-micromap-11648");
    if (ext || host)
        checkCount(device, place.command(), "infoCount", static_cast<uint32_t>(builds.micromaps.size()),
                   ext ? "VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength"
                       : "VUID-vkBuildMicromapsEXT-infoCount-arraylength");
    std::vector<BuildMemory> memory;
    for (input::MicromapBuild &build : builds.micromaps) {
        const Place element = place.element("pInfos", build.element);
        build.accesses = accessesOf(build);
        if (!core)
            continue;
        checkWhenExecuted(RuleCheck(device, element, build.target, commandBuffer), build);
        memory.push_back(memoryOf(device, build));
    }
    for (input::StructureBuild &build : builds.structures) {
        const Place element = place.element("pInfos", build.element);
        const RuleCheck check(device, element, build.given->dstAccelerationStructure, commandBuffer);
        build.accesses = accessesOf(build);
        if (core) {
            build.accepted = checkAddresses(check, build) && build.accepted;
            checkAttachments(check, build);
            checkUpdate(check, build);
        }
        if (build.accepted && (core || device.checks.sync)) { // nothing is known of a build with a mistake
            const VkAccelerationStructureBuildSizesInfoKHR sizes = sizesOf(device, build);
            const VkDeviceSize scratch = build.isUpdate() ? sizes.updateScratchSize : sizes.buildScratchSize;
            build.accepted = !core || checkScratch(check, build, scratch);
            if (build.accepted && scratch != 0)
                build.accesses.push_back(
                    {Of::Scratch, build.given->scratchData.deviceAddress, 0, scratch, input::Access::kNone});
            if (build.accepted)
                memory.push_back(memoryOf(device, build, sizes.accelerationStructureSize, scratch));
        }
        if (core)
            checkWhenExecuted(check, build);
    }
    if (!core)
        return;
    const RuleCheck check(device, place, commandBuffer, commandBuffer);
    std::ranges::sort(memory, {}, [](const BuildMemory &build) { return placeOf(build.targetRange); });
    for (const input::StructureBuild &build : builds.structures)
        checkAttachedMemory(check, build, memory);
    std::ranges::sort(memory, {}, &BuildMemory::element);
    checkOverlaps(check, memory, ext ? kMicromaps : host ? kHostMicromaps : kStructures);
}

} // namespace vellum::layer
