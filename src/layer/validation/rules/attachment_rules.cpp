// SPDX-License-Identifier: Apache-2.0
// Micromaps that geometries attach, and updates of structures with them.
#include "layer/validation/rules/build_rules.h"

namespace vellum::layer
{
namespace
{

struct AttachmentIds {
    const char *indexType;
    const char *stride;
    const char *strideRange;
    const char *noBuffer[2]; // of the command, and of the indirect one
    const char *buffer[2];
    const char *constructed[2];
    const char *noMicromap;
};

constexpr AttachmentIds kExtIds{
    .indexType = "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10719",
    .stride = "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10722",
    .strideRange = "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10723",
    .noBuffer = {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10904",
                 "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10904"},
    .buffer = {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10905",
               "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10905"},
    .constructed = {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11632",
                    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11632"},
    .noMicromap = nullptr,
};
constexpr AttachmentIds kKhrIds{
    .indexType = "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexType-11570",
    .stride = "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11573",
    .strideRange = "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexStride-11574",
    .noBuffer = {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11571",
                 "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11571"},
    .buffer = {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11572",
               "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11572"},
    .constructed = {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11701",
                    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11701"},
    .noMicromap = "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-11579",
};
constexpr UsageIds kUsageIds{"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-pUsageCounts-07335",
                             "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-format-11679",
                             "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11680",
                             "VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-subdivisionLevel-11681",
                             nullptr,
                             nullptr};
constexpr const char *kIsMicromap[] = {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11624",
                                       "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11624"};

// Bytes of an index; 0 for types that neither extension takes, UINT32_MAX for no indices.
uint32_t indexSize(const AttachmentInput &attachment)
{
    if (attachment.indexType == VK_INDEX_TYPE_NONE_KHR)
        return UINT32_MAX;
    return attachment.indexType == VK_INDEX_TYPE_UINT8_EXT && !attachment.khr ? 0 : indexBytes(attachment.indexType);
}

void checkIndices(const RuleCheck &check, bool indirect, const AttachmentInput &attachment, const AttachmentIds &ids)
{
    const uint32_t size = indexSize(attachment);
    const VkDeviceAddress buffer = attachment.indexBuffer.deviceAddress;
    if (size == UINT32_MAX) {
        check.require(buffer == 0, "indexBuffer", ids.noBuffer[indirect ? 1 : 0],
                      "it is not null, although indexType is VK_INDEX_TYPE_NONE_KHR");
        check.require(attachment.handle.handle != 0, "micromap", ids.noMicromap,
                      "it is VK_NULL_HANDLE, and indexType is VK_INDEX_TYPE_NONE_KHR");
        return;
    }
    if (size == 0)
        return check.fault("indexType", ids.indexType, std::to_string(attachment.indexType) + " is not allowed here");
    checkMultiple(check, attachment.indexStride, size, "indexStride", ids.stride);
    if (attachment.indexStride > UINT32_MAX)
        check.fault("indexStride", ids.strideRange, std::to_string(attachment.indexStride) + " is above 2^32-1");
    else
        check.require(buffer != 0, "indexBuffer", ids.buffer[indirect ? 1 : 0],
                      "the address is null, although there is an indexType");
}

// A structure of VK_KHR_opacity_micromap may hold something that is not a micromap.
void checkIsMicromap(const RuleCheck &check, bool indirect, const std::shared_ptr<ValidatedStructure> &micromap)
{
    check.whenExecuted(kIsMicromap[indirect ? 1 : 0], [&device = check.device(), micromap]() -> std::string {
        const auto contents = micromap->contents;
        if (!contents || contents->deserialized ||
            contents->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
            return {};
        return "the structure " + device.nameOf(micromap->handle) + " was not built as a micromap";
    });
}

// --- Updates ---

struct UpdateIds {
    const char *keepsMicromap, *keepsNull, *addsNone, *sameMicromap;
};
constexpr UpdateIds kUpdateIds[] = {{"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11625",
                                     "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11626",
                                     "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11627",
                                     "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11629"},
                                    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11625",
                                     "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11626",
                                     "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11627",
                                     "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11629"}};
constexpr VkFlags kReplaces = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR |
                              VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;

// What an update gives a geometry of triangles.
struct UpdatedGeometry {
    bool attaches = false;
    std::shared_ptr<ValidatedStructure> micromap;
    ObjectHandle handle;
};

// The rule that an update of a geometry breaks, and what is wrong; null if it breaks none.
const char *brokenBy(const GeometryContents &before, const UpdatedGeometry &now, bool replaces, const UpdateIds &ids,
                     std::string &text)
{
    if (!before.hasMicromap) {
        text = "the geometry was built without a micromap; the update attaches one";
        return now.attaches ? ids.addsNone : nullptr;
    }
    if (!before.khr)
        return nullptr;
    if (before.micromapHandle.handle == 0) {
        text = "the geometry was built with VK_NULL_HANDLE as its micromap; the update differs";
        return !now.attaches || now.handle.handle != 0 ? ids.keepsNull : nullptr;
    }
    text = "the geometry was built with a micromap; the update has none";
    if (!now.attaches || now.handle.handle == 0)
        return ids.keepsMicromap;
    text = "the update attaches another micromap, which the flags of the build do not allow";
    return !replaces && before.micromap.lock() != now.micromap ? ids.sameMicromap : nullptr;
}

void checkGeometryUpdate(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source, uint32_t g,
                         const UpdatedGeometry &now, const UpdateIds &ids)
{
    check.whenExecuted([&device = check.device(), place = check.place().text(), source, g, now, &ids] {
        const auto contents = source->contents;
        if (!contents || contents->deserialized || g >= contents->geometries.size())
            return;
        std::string text;
        if (const char *vuid = brokenBy(contents->geometries[g], now, (contents->flags & kReplaces) != 0, ids, text))
            device.fault(place, vuid, text, source->handle);
    });
}

} // namespace

void checkAttachment(const RuleCheck &check, bool indirect, const AttachmentInput &attachment)
{
    const AttachmentIds &ids = attachment.khr ? kKhrIds : kExtIds;
    checkIndices(check, indirect, attachment, ids);
    if (attachment.usageArrays > 1)
        check.fault("pUsageCounts", kUsageIds.arrays, "both pUsageCounts and ppUsageCounts are given");
    if (!attachment.micromap)
        return;
    if (!attachment.khr)
        checkUsages(check, attachment.usages, kUsageIds, check.device().limits.ext, false);
    checkConstructed(check, attachment.micromap, ids.constructed[indirect ? 1 : 0]);
    if (attachment.khr)
        checkIsMicromap(check, indirect, attachment.micromap);
}

void checkUpdate(const RuleCheck &check, bool indirect, const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    const auto source = check.device().objects.structures.get(info.srcAccelerationStructure);
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR || !source)
        return;
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        const VkAccelerationStructureGeometryKHR *geometry = geometryOf(info, g);
        if (!geometry || geometry->geometryType != VK_GEOMETRY_TYPE_TRIANGLES_KHR)
            continue;
        UpdatedGeometry now;
        if (const auto attachment = attachmentOf(check.device(), *geometry)) {
            if (!attachment->khr)
                continue;
            now = {true, attachment->micromap, attachment->handle};
        }
        const Place place = check.place().element("pGeometries", g);
        checkGeometryUpdate(check.at(place), source, g, now, kUpdateIds[indirect ? 1 : 0]);
    }
}

} // namespace vellum::layer
