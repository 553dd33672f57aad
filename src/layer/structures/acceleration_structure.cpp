#include "layer/structures/acceleration_structure.h"

#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/door/device.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

struct Notice {
    const char *id;
    const char *text;
};

// In the order of kNotice*.
constexpr Notice kNoticeTexts[kNotices] = {
    {"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414",
     "vkCmdCopyMemoryToAccelerationStructureKHR: the data comes from another driver, from another version of the "
     "layer, "
     "or from a device without the layer. The structure has no geometry now"},
    {"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960",
     "vkCmdCopyMemoryToAccelerationStructureKHR: the memory does not hold serialized data, or not all of it, or it was "
     "changed. The structure has no geometry now"},
    {"VELLUM-serialized-type",
     "vkCmdCopyMemoryToAccelerationStructureKHR: top-level data for a bottom-level structure, or the other way round. "
     "The structure has no geometry now"},
    {"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746",
     "vkCmdCopyMemoryToAccelerationStructureKHR: dst is smaller than the deserialized size. It has no geometry now"},
    {"VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561",
     "vkCmdCopyAccelerationStructureToMemoryKHR: the buffer ends before the serialized data does. Nothing was written"},
    {"VELLUM-copy-reference",
     "a copied or deserialized top-level structure names a bottom-level structure that does not exist; such instances "
     "are inactive"},
    {"VELLUM-copy-unbuilt-reference", "a top-level structure was copied or deserialized before the bottom-level "
                                      "structures were built that it names; such "
                                      "instances are inactive"},
    {"VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12419",
     "vkCmdCopyAccelerationStructureKHR: dst is too small for the copy, and has no geometry now"},
    {"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585",
     "vkCmdCopyMemoryToAccelerationStructureKHR: the data names a micromap that does not exist, or is smaller than the "
     "one that was serialized. Its geometry has no micromap now"},
    {"VELLUM-micromap-copy-size",
     "a micromap was copied, serialized or deserialized to where there is less room than it "
     "needs. Micromaps that were the target hold nothing now"},
    {"VELLUM-micromap-not-constructed", "a micromap was copied or serialized before it was built"},
    {"VELLUM-micromap-serialized",
     "a micromap was deserialized from memory that does not hold a serialized micromap of "
     "this version of the layer, or not all of it. It holds nothing now"},
};

} // namespace

CellPlace cellOf(Device &device, AccelerationStructure &structure, VkAccelerationStructureKHR handle)
{
    std::lock_guard lock(structure.mutex);
    if (!structure.cell.address) {
        structure.reference = device.structureAddress(handle);
        structure.cell = device.root.acquireCell(structure.reference);
    }
    return structure.cell;
}

std::shared_ptr<SlotRange> slotsFor(Device &device, AccelerationStructure &structure, uint32_t count)
{
    std::lock_guard lock(structure.mutex);
    const uint32_t had = structure.slots ? structure.slots->count() : 0;
    if (structure.slots && had >= count)
        return structure.slots;
    auto slots = device.root.allocateSlots(std::max(count, had + had / 2));
    if (!slots)
        slots = device.root.allocateSlots(count);
    if (!slots)
        return nullptr;
    if (structure.slots)
        structure.outgrownSlots.push_back(std::move(structure.slots));
    structure.slots = slots;
    return slots;
}

VkDeviceAddress beginOf(const Device &device, const AccelerationStructure &structure)
{
    return device.bufferAddress(structure.buffer) + structure.offset;
}

uint32_t unitsOf(VkDeviceSize bytes)
{
    return static_cast<uint32_t>(std::min<VkDeviceSize>(bytes / 16, UINT32_MAX));
}

void reportNotices(Device &device)
{
    const uint32_t bits = device.root.takeNotices();
    for (uint32_t i = 0; bits != 0 && i < kNotices; ++i) {
        if ((bits >> i & 1u) != 0)
            device.report().error(kNoticeTexts[i].id, kNoticeTexts[i].text);
    }
}

VKAPI_ATTR VkResult VKAPI_CALL createAccelerationStructure(VkDevice handle,
                                                           const VkAccelerationStructureCreateInfoKHR *info,
                                                           const VkAllocationCallbacks *allocator,
                                                           VkAccelerationStructureKHR *result)
{
    Device &device = deviceOf(handle);
    auto structure = std::make_shared<AccelerationStructure>();
    structure->buffer = info->buffer;
    structure->offset = info->offset;
    structure->size = info->size;
    structure->type = info->type;
    structure->content = info->type;
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        device.report().error("VELLUM-VUID-VkAccelerationStructureCreateInfoKHR-type-11600",
                              "vkCreateAccelerationStructureKHR: a micromap is made by "
                              "vkCreateAccelerationStructure2KHR");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    const VkResult created = device.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    structure->micromap = {info->buffer,
                           info->offset,
                           info->size,
                           {VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(*result)}};
    letMicromapBeNamedOnceBound(device, structure);
    device.accelerationStructures.set(*result, std::move(structure));
    return created;
}

VKAPI_ATTR void VKAPI_CALL destroyAccelerationStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                                        const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    const auto known = device.accelerationStructures.take(structure);
    if (known && known->cell.address)
        device.root.releaseCell(known->reference);
    if (known && known->micromapKey)
        device.root.releaseCell(known->micromapKey);
    if (known && known->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        device.privateData.forgetObject(reinterpret_cast<uint64_t>(structure));
        device.report().setName(reinterpret_cast<uint64_t>(structure), "");
        return;
    }
    device.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL
getAccelerationStructureDeviceAddress(VkDevice handle, const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    Device &device = deviceOf(handle);
    // Whoever names a structure to an instance asks for its address: from now on copies of top-level structures know
    // that it exists.
    if (const auto structure = device.accelerationStructures.get(info->accelerationStructure)) {
        if (structure->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
            return beginOf(device, *structure);
        cellOf(device, *structure, info->accelerationStructure);
    }
    return device.next.GetAccelerationStructureDeviceAddressKHR(handle, info);
}

VKAPI_ATTR void VKAPI_CALL getAccelerationStructureBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                                              const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                                              const uint32_t *maxPrimitives,
                                                              VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    Device &device = deviceOf(handle);
    if (isMicromapBuild(*info))
        return getMicromapStructureSizes(device, *info, *sizes);
    DriverBuildInfo build(*info);
    if (build.hasMicromapGeometry()) {
        device.report().error("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                              "vkGetAccelerationStructureBuildSizesKHR: a geometry of type "
                              "VK_GEOMETRY_TYPE_MICROMAP_KHR in a build that is none of a micromap");
        sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
        return;
    }
    device.next.GetAccelerationStructureBuildSizesKHR(handle, type, &build.info(), maxPrimitives, sizes);
    if (build.topLevel() && build.geometryCount() == 1) {
        const uint32_t count = maxPrimitives ? maxPrimitives[0] : 0;
        sizes->accelerationStructureSize = topLevelBytes(device, info->flags, count);
        sizes->buildScratchSize =
            topLevelDriverSizes(device, info->flags, count).buildScratchSize + patchedInstancesBytes(count);
        sizes->updateScratchSize = sizes->buildScratchSize; // an update is a build
    } else if (const VkDeviceSize tail = bottomLevelTailBytes(build, maxPrimitives)) {
        sizes->accelerationStructureSize = alignUp(sizes->accelerationStructureSize, kPartAlignment) + tail;
    }
}

} // namespace vellum::layer
