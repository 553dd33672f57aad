// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_input.h"

#include <string>

namespace vellum::layer
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;

constexpr VkStructureType kAttachmentEXT = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT;
constexpr VkStructureType kAttachmentKHR = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;

// A driver with micromaps knows VkAccelerationStructureTrianglesOpacityMicromapEXT.
std::optional<MicromapAttachment> attachmentIn(const Driver &driver, const void *chain)
{
    if (const auto *khr = findInChain<VkAccelerationStructureTrianglesOpacityMicromapKHR>(chain, kAttachmentKHR))
        return MicromapAttachment{
            khr->indexType, khr->indexBuffer, khr->indexStride, khr->baseTriangle, VK_NULL_HANDLE, khr->micromap, {},
            nullptr};
    const auto *ext = findInChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(chain, kAttachmentEXT);
    if (ext && driver.emulated())
        return MicromapAttachment{ext->indexType,
                                  ext->indexBuffer.deviceAddress,
                                  ext->indexStride,
                                  ext->baseTriangle,
                                  ext->micromap,
                                  VK_NULL_HANDLE,
                                  {},
                                  nullptr};
    return std::nullopt;
}

void parseTriangles(const Driver &driver, VkAccelerationStructureGeometryTrianglesDataKHR &triangles,
                    GeometryInput &input)
{
    input.micromap = attachmentIn(driver, triangles.pNext);
    if (!input.micromap)
        return;
    Chain &chain = input.chain.emplace(triangles.pNext);
    chain.remove(kAttachmentKHR);
    if (driver.emulated()) {
        chain.remove(kAttachmentEXT);
        // It contains a VkMicromapEXT. The layer hides its extension.
        chain.remove(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_DISPLACEMENT_MICROMAP_NV);
    }
    triangles.pNext = chain.head();
}

bool checkMode(const InputCheck &check, VkCopyAccelerationStructureModeKHR mode,
               VkCopyAccelerationStructureModeKHR expected, const char *id, const char *text)
{
    return mode == expected || check.tolerate(id, text);
}

} // namespace

std::vector<uint32_t> StructureBuild::primitives() const
{
    std::vector<uint32_t> result(geometries.size());
    for (uint32_t g = 0; g < result.size(); ++g)
        result[g] = ranges.primitives(g);
    return result;
}

const BuildInfo &StructureBuild::driverInfo()
{
    info.geometryCount = geometryCount();
    info.pGeometries = geometries.empty() ? nullptr : geometries.data();
    info.ppGeometries = nullptr;
    return info;
}

std::optional<StructureBuild> parseStructureBuild(const Driver &driver, const InputCheck &check, const BuildInfo &info)
{
    StructureBuild build;
    build.info = info;
    // It is ignored, and may be the handle of a micromap.
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR)
        build.info.srcAccelerationStructure = VK_NULL_HANDLE;
    for (uint32_t i = 0; i < info.geometryCount; ++i) {
        const VkAccelerationStructureGeometryKHR *given = info.pGeometries    ? info.pGeometries + i
                                                          : info.ppGeometries ? info.ppGeometries[i]
                                                                              : nullptr;
        if (!given) {
            check.reject("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788",
                         "geometryCount is not 0, but a geometry is a null pointer");
            return std::nullopt;
        }
        // The driver does not know this type.
        if (given->geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR) {
            check.reject("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                         "a geometry of type VK_GEOMETRY_TYPE_MICROMAP_KHR in a build of another type than micromap");
            return std::nullopt;
        }
        VkAccelerationStructureGeometryKHR &geometry = build.geometries.emplace_back(*given);
        GeometryInput &input = build.inputs.emplace_back();
        input.opaque = (geometry.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0;
        // The geometries determine the type of a GENERIC structure.
        build.topLevel = build.topLevel || geometry.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR;
        build.hasBoxes = build.hasBoxes || geometry.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR;
        if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR)
            parseTriangles(driver, geometry.geometry.triangles, input);
        build.hasMicromaps = build.hasMicromaps || input.micromap;
    }
    return build;
}

namespace
{

bool checkAttachment(const DeviceState &objects, const InputCheck &check, const MicromapSet &built, uint32_t geometry,
                     MicromapAttachment &attachment)
{
    if (attachment.ext)
        attachment.micromap = *micromapOf(attachment.ext);
    if (!attachment.khr)
        return true;
    const std::string where = "geometry " + std::to_string(geometry) + ": ";
    attachment.structure = objects.accelerationStructures.get(attachment.khr);
    if (!attachment.structure || !canHoldMicromap(*attachment.structure))
        return check.reject("VELLUM-VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter",
                            where + "micromap is not a micromap of this device");
    attachment.micromap = micromapIn(*attachment.structure);
    // Tolerated: micromaps are built first, with a barrier.
    return !built.contains(attachment.khr) ||
           check.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548",
                          where + "micromap is built by the same command");
}

} // namespace

bool checkStructureBuild(const DeviceState &objects, const InputCheck &check, const MicromapSet &built,
                         StructureBuild &build)
{
    build.target = objects.accelerationStructures.get(build.info.dstAccelerationStructure);
    // The driver does not know the handles of micromaps.
    if (!build.target || isLayerObject(*build.target))
        return check.reject(
            "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-dstAccelerationStructure-parameter",
            "dstAccelerationStructure is not an acceleration structure of this device");
    // Only builds of micromaps have no ranges.
    if (!build.ranges.direct && !build.ranges.most) {
        if (build.geometryCount() > 0)
            return check.reject("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543",
                                "the numbers of primitives of the geometries are a null pointer");
        static constexpr VkAccelerationStructureBuildRangeInfoKHR kNone{};
        build.ranges.direct = &kNone;
    }
    if (build.info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR) {
        build.source = objects.accelerationStructures.get(build.info.srcAccelerationStructure);
        if (!build.source || isLayerObject(*build.source))
            return check.reject(
                build.info.srcAccelerationStructure
                    ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629"
                    : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630",
                "srcAccelerationStructure is not an acceleration structure of this device that can be updated");
    }
    if (build.topLevel && build.geometryCount() != 1)
        return check.reject("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03790",
                            "a top-level structure has one geometry");
    for (uint32_t g = 0; g < build.geometryCount(); ++g) {
        if (build.inputs[g].micromap && !checkAttachment(objects, check, built, g, *build.inputs[g].micromap))
            return false;
    }
    return true;
}

std::optional<StructureCopy> parseStructureCopy(const DeviceState &objects, const char *command,
                                                const VkCopyAccelerationStructureInfoKHR &info)
{
    constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    const InputCheck check = inputCheck(objects.driver, command, info.dst);
    const auto reject = [&](const char *id, const std::string &text) {
        check.reject(id, text);
        return std::nullopt;
    };
    StructureCopy copy;
    copy.source = objects.accelerationStructures.get(info.src);
    copy.target = objects.accelerationStructures.get(info.dst);
    if (!copy.source)
        return reject("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-src-parameter",
                      "src is not an acceleration structure of this device");
    if (!copy.target)
        return reject("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter",
                      "dst is not an acceleration structure of this device");
    copy.type = isLayerObject(*copy.target) ? copy.target->type : contentOf(objects.driver, *copy.source);
    if (copy.type == kGeneric)
        copy.type = copy.target->type;
    if (copy.isMicromap() && (!canHoldMicromap(*copy.source) || !canHoldMicromap(*copy.target)))
        return reject("VELLUM-copy-type", "one of src and dst is not a micromap");
    if (copy.source->location == copy.target->location ||
        (!copy.isMicromap() && objects.driver.structureAddress(info.src) == objects.driver.structureAddress(info.dst)))
        return reject("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", "src and dst are the same memory");
    copy.compact = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    // Tolerated: other modes are clones, as in drivers.
    if (!copy.compact &&
        !checkMode(check, info.mode, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR,
                   "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410", "mode is neither CLONE nor COMPACT"))
        return std::nullopt;
    if (copy.type == kGeneric) {
        objects.driver.report().notAvailable(std::string(command) + " between two structures of type GENERIC, "
                                                                    "recorded before any build of the source,");
        return std::nullopt;
    }
    if (copy.target->type != kGeneric && copy.target->type != copy.type)
        return reject("VELLUM-copy-type", "dst was created with another type than src");
    return copy;
}

std::optional<SerializedCopy> parseSave(const DeviceState &objects, const char *command,
                                        const VkCopyAccelerationStructureToMemoryInfoKHR &info)
{
    const InputCheck check = inputCheck(objects.driver, command, info.src);
    SerializedCopy copy{objects.accelerationStructures.get(info.src), info.dst.deviceAddress};
    if (!copy.structure) {
        check.reject("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter",
                     "src is not an acceleration structure of this device");
        return std::nullopt;
    }
    if (!checkMode(check, info.mode, VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR,
                   "VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", "mode is not SERIALIZE"))
        return std::nullopt;
    copy.content = contentOf(objects.driver, *copy.structure);
    const bool micromap = copy.content == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    if (copy.content == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR) {
        objects.driver.report().notAvailable(std::string(command) +
                                             " of a GENERIC structure recorded before any build of it");
        return std::nullopt;
    }
    if (!check.checkSerializedAddress(copy.data, micromap ? 128 : 256,
                                      "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739",
                                      micromap ? "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699"
                                               : "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740"))
        return std::nullopt;
    return copy;
}

std::optional<SerializedCopy> parseRestore(const DeviceState &objects, const char *command,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR &info)
{
    const InputCheck check = inputCheck(objects.driver, command, info.dst);
    SerializedCopy copy{objects.accelerationStructures.get(info.dst), info.src.deviceAddress};
    if (!copy.structure) {
        check.reject("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter",
                     "dst is not an acceleration structure of this device");
        return std::nullopt;
    }
    const bool micromap = objects.driver.enabled.khr && canHoldMicromap(*copy.structure);
    // The specification names 11700, a rule of this command, after the other one.
    if (!checkMode(check, info.mode, VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR,
                   "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", "mode is not DESERIALIZE") ||
        !check.checkSerializedAddress(
            copy.data, micromap ? 128 : 256, "VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742",
            isLayerObject(*copy.structure) ? "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700"
                                           : "VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03743"))
        return std::nullopt;
    return copy;
}

} // namespace vellum::layer
