// SPDX-License-Identifier: Apache-2.0
// Acceleration structures, and the objects that names and private data are for.
#include "layers/spy.h"

#include <map>
#include <utility>

namespace spy
{
namespace
{

void expectBuild(void *key, const char *where, const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    constexpr VkFlags ext = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
                            VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT |
                            VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
    if (info.type > VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        report(std::string(where) + ": a type that the driver does not know");
    if ((info.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR) != 0)
        report(std::string(where) + ": VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR");
    if (!knowsMicromaps(key) && (info.flags & ext) != 0)
        report(std::string(where) + ": micromap build flags");
    for (uint32_t i = 0; i < info.geometryCount; ++i) {
        const VkAccelerationStructureGeometryKHR &geometry =
            info.pGeometries != nullptr ? info.pGeometries[i] : *info.ppGeometries[i];
        if (geometry.geometryType > VK_GEOMETRY_TYPE_INSTANCES_KHR)
            report(std::string(where) + ": a type of geometry that the driver does not know");
        if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR &&
            inChain(geometry.geometry.triangles.pNext,
                    VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR) != nullptr)
            report(std::string(where) + ": VkAccelerationStructureTrianglesOpacityMicromapKHR");
        if (!knowsMicromaps(key) && geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR &&
            inChain(geometry.geometry.triangles.pNext,
                    VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT) != nullptr)
            report(std::string(where) + ": VkAccelerationStructureTrianglesOpacityMicromapEXT");
    }
}

// Acceleration structures that are the driver's: others, which the layer has by itself, must not come here.
struct Known {
    VkBuffer buffer;
    uint64_t destroyed; // buffers of that handle that had been destroyed before
    VkDeviceSize offset;
};
std::map<VkAccelerationStructureKHR, Known> known;
// How many there are at each place. The layer's own handles must not accumulate.
constexpr int kMostAtOnePlace = 1000;
std::map<std::pair<VkBuffer, VkDeviceSize>, int> atPlace;
std::map<VkBuffer, uint64_t> destroyedBuffers;
std::mutex knownMutex;

// True if the driver created it; the spy reports others.
bool expectStructure(const char *where, VkAccelerationStructureKHR structure)
{
    bool theDrivers = structure == VK_NULL_HANDLE;
    {
        std::lock_guard lock(knownMutex);
        theDrivers = theDrivers || known.contains(structure);
    }
    if (!theDrivers)
        report(std::string(where) + ": an acceleration structure that is not the driver's");
    return theDrivers;
}

bool expectObject(void *key, const char *where, VkObjectType type, uint64_t object)
{
    if (type == VK_OBJECT_TYPE_MICROMAP_EXT && knowsMicromaps(key))
        return true;
    if (type == VK_OBJECT_TYPE_MICROMAP_EXT)
        report(std::string(where) + ": an object of type VK_OBJECT_TYPE_MICROMAP_EXT");
    if (type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR)
        return expectStructure(where, reinterpret_cast<VkAccelerationStructureKHR>(object));
    return type != VK_OBJECT_TYPE_MICROMAP_EXT;
}

VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *allocator,
                                               VkAccelerationStructureKHR *structure)
{
    if (info->type > VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        report("vkCreateAccelerationStructureKHR: a type that the driver does not know");
    const VkResult result = SPY_NEXT(vkCreateAccelerationStructureKHR)(handle, info, allocator, structure);
    std::lock_guard lock(knownMutex);
    if (result != VK_SUCCESS)
        return result;
    known[*structure] = {info->buffer, destroyedBuffers[info->buffer], info->offset};
    if (++atPlace[{info->buffer, info->offset}] > kMostAtOnePlace)
        report("vkCreateAccelerationStructureKHR: more than 1,000 structures at one place");
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(knownMutex);
        ++destroyedBuffers[buffer];
    }
    SPY_NEXT(vkDestroyBuffer)(handle, buffer, allocator);
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *allocator)
{
    expectStructure("vkDestroyAccelerationStructureKHR", structure);
    {
        std::lock_guard lock(knownMutex);
        if (const auto one = known.find(structure); one != known.end()) {
            const auto place = atPlace.find({one->second.buffer, one->second.offset});
            if (--place->second == 0)
                atPlace.erase(place);
            known.erase(one);
        }
    }
    SPY_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

VKAPI_ATTR void VKAPI_CALL copyStructure(VkCommandBuffer handle, const VkCopyAccelerationStructureInfoKHR *info)
{
    expectStructure("vkCmdCopyAccelerationStructureKHR", info->src);
    expectStructure("vkCmdCopyAccelerationStructureKHR", info->dst);
    SPY_NEXT(vkCmdCopyAccelerationStructureKHR)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL writeProperties(VkCommandBuffer handle, uint32_t count,
                                           const VkAccelerationStructureKHR *list, VkQueryType type, VkQueryPool pool,
                                           uint32_t first)
{
    for (const VkAccelerationStructureKHR structure : std::span(list, count))
        expectStructure("vkCmdWriteAccelerationStructuresPropertiesKHR", structure);
    SPY_NEXT(vkCmdWriteAccelerationStructuresPropertiesKHR)(handle, count, list, type, pool, first);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL structureAddress(VkDevice handle,
                                                       const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    if (expectStructure("vkGetAccelerationStructureDeviceAddressKHR", info->accelerationStructure)) {
        std::lock_guard lock(knownMutex);
        const auto [buffer, destroyed, offset] = known[info->accelerationStructure];
        if (destroyedBuffers[buffer] != destroyed)
            report("vkGetAccelerationStructureDeviceAddressKHR: a structure whose buffer is gone");
    }
    return SPY_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL setPrivateData(VkDevice handle, VkObjectType type, uint64_t object,
                                              VkPrivateDataSlot slot, uint64_t data)
{
    return expectObject(keyOf(handle), "vkSetPrivateData", type, object)
               ? SPY_NEXT(vkSetPrivateData)(handle, type, object, slot, data)
               : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL getPrivateData(VkDevice handle, VkObjectType type, uint64_t object, VkPrivateDataSlot slot,
                                          uint64_t *data)
{
    if (expectObject(keyOf(handle), "vkGetPrivateData", type, object))
        SPY_NEXT(vkGetPrivateData)(handle, type, object, slot, data);
}

VKAPI_ATTR VkResult VKAPI_CALL setName(VkDevice handle, const VkDebugUtilsObjectNameInfoEXT *info)
{
    const auto next = SPY_NEXT(vkSetDebugUtilsObjectNameEXT);
    return expectObject(keyOf(handle), "vkSetDebugUtilsObjectNameEXT", info->objectType, info->objectHandle) &&
                   next != nullptr
               ? next(handle, info)
               : VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL setTag(VkDevice handle, const VkDebugUtilsObjectTagInfoEXT *info)
{
    const auto next = SPY_NEXT(vkSetDebugUtilsObjectTagEXT);
    return expectObject(keyOf(handle), "vkSetDebugUtilsObjectTagEXT", info->objectType, info->objectHandle) &&
                   next != nullptr
               ? next(handle, info)
               : VK_SUCCESS;
}

// Offered on lavapipe, too, which lacks VK_EXT_debug_marker.
VKAPI_ATTR VkResult VKAPI_CALL setMarkerName(VkDevice handle, const VkDebugMarkerObjectNameInfoEXT *info)
{
    expectObject(keyOf(handle), "vkDebugMarkerSetObjectNameEXT", static_cast<VkObjectType>(info->objectType),
                 info->object);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL setMarkerTag(VkDevice handle, const VkDebugMarkerObjectTagInfoEXT *info)
{
    expectObject(keyOf(handle), "vkDebugMarkerSetObjectTagEXT", static_cast<VkObjectType>(info->objectType),
                 info->object);
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL getBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                         const uint32_t *counts, VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    expectBuild(keyOf(handle), "vkGetAccelerationStructureBuildSizesKHR", *info);
    SPY_NEXT(vkGetAccelerationStructureBuildSizesKHR)(handle, type, info, counts, sizes);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    for (uint32_t i = 0; i < count; ++i)
        expectBuild(keyOf(handle), "vkCmdBuildAccelerationStructuresKHR", infos[i]);
    noteBuild(handle);
    SPY_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    for (uint32_t i = 0; i < count; ++i)
        expectBuild(keyOf(handle), "vkCmdBuildAccelerationStructuresIndirectKHR", infos[i]);
    noteBuild(handle);
    SPY_NEXT(vkCmdBuildAccelerationStructuresIndirectKHR)(handle, count, infos, addresses, strides, most);
}

} // namespace

std::span<const Row> structures()
{
    static const Row rows[]{
        {"vkCreateAccelerationStructureKHR", SPY_FUNCTION(createStructure)},
        {"vkDestroyAccelerationStructureKHR", SPY_FUNCTION(destroyStructure)},
        {"vkCmdCopyAccelerationStructureKHR", SPY_FUNCTION(copyStructure)},
        {"vkCmdWriteAccelerationStructuresPropertiesKHR", SPY_FUNCTION(writeProperties)},
        {"vkDestroyBuffer", SPY_FUNCTION(destroyBuffer)},
        {"vkGetAccelerationStructureDeviceAddressKHR", SPY_FUNCTION(structureAddress)},
        {"vkSetPrivateData", SPY_FUNCTION(setPrivateData)},
        {"vkGetPrivateData", SPY_FUNCTION(getPrivateData)},
        {"vkSetDebugUtilsObjectNameEXT", SPY_FUNCTION(setName)},
        {"vkSetDebugUtilsObjectTagEXT", SPY_FUNCTION(setTag)},
        {"vkGetAccelerationStructureBuildSizesKHR", SPY_FUNCTION(getBuildSizes)},
        {"vkCmdBuildAccelerationStructuresKHR", SPY_FUNCTION(cmdBuild)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", SPY_FUNCTION(cmdBuildIndirect)},
        {"vkDebugMarkerSetObjectNameEXT", SPY_FUNCTION(setMarkerName), Row::Where::Always},
        {"vkDebugMarkerSetObjectTagEXT", SPY_FUNCTION(setMarkerTag), Row::Where::Always},
    };
    return rows;
}

} // namespace spy
