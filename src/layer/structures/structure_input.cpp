// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_input.h"

#include <string>

#include "layer/input/checked.h"
#include "layer/rules/copies.h"

namespace vellum::layer
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;

// Takes the micromap from a geometry. A driver with micromaps knows VkAccelerationStructureTrianglesOpacityMicromapEXT.
void takeMicromap(const Driver &driver, const input::Attachment &attachment,
                  VkAccelerationStructureGeometryTrianglesDataKHR &triangles, GeometryInput &input)
{
    if (!attachment.khr && !driver.emulated())
        return;
    input.micromap = {attachment, {}, nullptr};
    Chain &chain = input.chain.emplace(triangles.pNext);
    chain.remove(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR);
    if (driver.emulated()) {
        chain.remove(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT);
        // It contains a VkMicromapEXT. The layer hides its extension.
        chain.remove(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_DISPLACEMENT_MICROMAP_NV);
    }
    triangles.pNext = chain.head();
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

StructureBuild structureBuildOf(const Driver &driver, const input::StructureBuild &given)
{
    StructureBuild build;
    build.element = given.element;
    build.info = *given.given;
    // It is ignored, and may be the handle of a micromap.
    if (!given.isUpdate())
        build.info.srcAccelerationStructure = VK_NULL_HANDLE;
    build.topLevel = given.isTopLevel();
    build.geometries.reserve(given.geometries.size());
    build.inputs.reserve(given.geometries.size());
    for (const input::Geometry &part : given.geometries) {
        VkAccelerationStructureGeometryKHR &geometry = build.geometries.emplace_back(*part.given);
        GeometryInput &input = build.inputs.emplace_back();
        input.opaque = (geometry.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0;
        build.hasBoxes = build.hasBoxes || geometry.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR;
        if (part.attachment)
            takeMicromap(driver, *part.attachment, geometry.geometry.triangles, input);
        build.hasMicromaps = build.hasMicromaps || input.micromap;
    }
    build.ranges = given.ranges;
    static constexpr VkAccelerationStructureBuildRangeInfoKHR kNone{};
    if (!build.ranges.given() && build.geometries.empty())
        build.ranges.direct = &kNone;
    return build;
}

bool findStructures(const DeviceState &objects, StructureBuild &build)
{
    const auto &structures = objects.accelerationStructures;
    build.target = structures.get(build.info.dstAccelerationStructure);
    const bool update = build.info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    if (update)
        build.source = structures.get(build.info.srcAccelerationStructure);
    for (GeometryInput &input : build.inputs) {
        const ObjectHandle handle = input.micromap ? input.micromap->given.micromap : ObjectHandle();
        if (!handle)
            continue;
        if (handle.type == VK_OBJECT_TYPE_MICROMAP_EXT) {
            input.micromap->micromap = *reinterpret_cast<const Micromap *>(handle.handle);
            continue;
        }
        input.micromap->structure = structures.get(reinterpret_cast<VkAccelerationStructureKHR>(handle.handle));
        if (!input.micromap->structure)
            return false;
        input.micromap->micromap = micromapIn(*input.micromap->structure);
    }
    return build.target && (build.source || !update);
}

ObjectFacts structureFacts(const DeviceState &objects, ObjectHandle handle)
{
    const auto structure =
        objects.accelerationStructures.get(reinterpret_cast<VkAccelerationStructureKHR>(handle.handle));
    return structure ? ObjectFacts{.exists = true,
                                   .type = structure->type,
                                   .content = contentOf(objects.driver, *structure),
                                   .size = structure->size}
                     : ObjectFacts{};
}

std::optional<StructureCopy> structureCopyOf(const DeviceState &objects, const char *command,
                                             const VkCopyAccelerationStructureInfoKHR &info)
{
    constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    StructureCopy copy;
    copy.source = objects.accelerationStructures.get(info.src);
    copy.target = objects.accelerationStructures.get(info.dst);
    const auto given = input::Checked<input::Copy>::take(&info, [&] {
        input::Copy parsed = input::parse(info);
        const Place place(command);
        const Place member = place.member("pInfo");
        const bool same = copy.source && copy.target &&
                          (copy.source->location == copy.target->location ||
                           (!isLayerObject(*copy.source) && !isLayerObject(*copy.target) &&
                            objects.driver.structureAddress(info.src) == objects.driver.structureAddress(info.dst)));
        rules::checkCopy(InputCheck(objects.rules, member, parsed.target), parsed,
                         {{.exists = copy.source != nullptr}, {.exists = copy.target != nullptr}, same});
        return parsed;
    });
    if (!given.accepted || !copy.source || !copy.target)
        return std::nullopt;
    copy.compact = given.isCompaction;
    copy.type = isLayerObject(*copy.target) ? copy.target->type : contentOf(objects.driver, *copy.source);
    if (copy.type == kGeneric)
        copy.type = copy.target->type;
    if (copy.type == kGeneric) {
        objects.driver.report().notAvailable(std::string(command) + " between two structures of type GENERIC, "
                                                                    "recorded before any build of the source,");
        return std::nullopt;
    }
    const bool micromaps = canHoldMicromap(*copy.source) && canHoldMicromap(*copy.target);
    // The driver may have deserialized a structure of any type of its own into a GENERIC one (becomesStructure).
    const bool isKnown = objects.driver.emulated() || copy.source->type != kGeneric;
    const bool differs = isKnown && copy.target->type != kGeneric && copy.target->type != copy.type;
    if (copy.isMicromap() ? !micromaps : differs) {
        rejectCommand(objects.driver, command, info.dst, "VELLUM-copy-type",
                      copy.isMicromap() ? "one of src and dst is not a micromap"
                                        : "dst was created with another type than src");
        return std::nullopt;
    }
    return copy;
}

namespace
{

template <typename Info>
std::optional<SerializedCopy> serializedCopyOf(const DeviceState &objects, const char *command, const Info &info,
                                               VkAccelerationStructureKHR handle)
{
    const auto given = rules::takeCopy(objects.rules, command, info, input::Executor::Device,
                                       [&](ObjectHandle object) { return structureFacts(objects, object); });
    SerializedCopy copy{objects.accelerationStructures.get(handle), given.data.deviceAddress};
    if (!given.accepted || !copy.structure)
        return std::nullopt;
    return copy;
}

} // namespace

std::optional<SerializedCopy> saveOf(const DeviceState &objects, const char *command,
                                     const VkCopyAccelerationStructureToMemoryInfoKHR &info)
{
    auto copy = serializedCopyOf(objects, command, info, info.src);
    if (!copy)
        return std::nullopt;
    copy->content = contentOf(objects.driver, *copy->structure);
    if (copy->content == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR) {
        objects.driver.report().notAvailable(std::string(command) +
                                             " of a GENERIC structure recorded before any build of it");
        return std::nullopt;
    }
    return copy;
}

std::optional<SerializedCopy> restoreOf(const DeviceState &objects, const char *command,
                                        const VkCopyMemoryToAccelerationStructureInfoKHR &info)
{
    return serializedCopyOf(objects, command, info, info.dst);
}

void DriverBuilds::add(const VkAccelerationStructureBuildGeometryInfoKHR &info, const input::BuildRanges &ranges)
{
    if (ranges.direct) {
        direct_.push_back(info);
        ranges_.push_back(ranges.direct);
    } else {
        indirect_.push_back(info);
        addresses_.push_back(ranges.indirect);
        strides_.push_back(ranges.stride);
        most_.push_back(ranges.most);
    }
}

void DriverBuilds::record(const Driver &driver, VkCommandBuffer commandBuffer) const
{
    if (!direct_.empty())
        driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer, static_cast<uint32_t>(direct_.size()),
                                                      direct_.data(), ranges_.data());
    if (!indirect_.empty())
        driver.next.CmdBuildAccelerationStructuresIndirectKHR(commandBuffer, static_cast<uint32_t>(indirect_.size()),
                                                              indirect_.data(), addresses_.data(), strides_.data(),
                                                              most_.data());
}

} // namespace vellum::layer
