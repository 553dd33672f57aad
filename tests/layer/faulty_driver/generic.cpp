// SPDX-License-Identifier: Apache-2.0
// A fault in acceleration structures of type GENERIC, whose size is an upper bound.
#include "faulty_driver/faults.h"

#include <map>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Generic;

struct Range {
    VkDeviceAddress address = 0;
    VkDeviceSize size = 0;
};
std::mutex mutex;
std::map<VkAccelerationStructureKHR, Range> generic;

void note(VkAccelerationStructureKHR structure, VkAccelerationStructureTypeKHR type, Range range)
{
    std::lock_guard lock(mutex);
    if (type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        generic[structure] = range;
}

VKAPI_ATTR VkResult VKAPI_CALL create(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *structure)
{
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructureKHR)(handle, info, allocator, structure);
    const auto query = vkInit<VkBufferDeviceAddressInfo>({.buffer = info->buffer});
    if (result == VK_SUCCESS)
        note(*structure, info->type,
             {DRIVER_NEXT(vkGetBufferDeviceAddress)(handle, &query) + info->offset, info->size});
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL create2(VkDevice handle, const VkAccelerationStructureCreateInfo2KHR *info,
                                       const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *structure)
{
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructure2KHR)(handle, info, allocator, structure);
    if (result == VK_SUCCESS)
        note(*structure, info->type, {info->addressRange.address, info->addressRange.size});
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroy(VkDevice handle, VkAccelerationStructureKHR structure,
                                   const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        generic.erase(structure);
    }
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

// The part of the target's range that the build does not need, where the target is GENERIC.
Range unneeded(VkCommandBuffer handle, const BuildInfo &info, const RangeInfo *ranges)
{
    Range range;
    {
        std::lock_guard lock(mutex);
        const auto found = generic.find(info.dstAccelerationStructure);
        if (found == generic.end())
            return {};
        range = found->second;
    }
    std::vector<uint32_t> most;
    for (uint32_t g = 0; ranges != nullptr && g < info.geometryCount; ++g)
        most.push_back(ranges[g].primitiveCount);
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)
    (deviceOf(keyOf(handle)), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, most.data(), &sizes);
    const VkDeviceSize needed = std::min(sizes.accelerationStructureSize, range.size);
    return {range.address + needed, range.size - needed};
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                    const RangeInfo *const *ranges)
{
    for (uint32_t i = 0; has(keyOf(handle), "generic-cleared-to-its-end") && i < count; ++i) {
        const Range range = unneeded(handle, infos[i], ranges != nullptr ? ranges[i] : nullptr);
        if (range.size > 0)
            beforeExecution(handle, [range] { std::memset(hostPointer<void>(range.address), 0, range.size); });
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

} // namespace

LevelRows genericRows()
{
    static const Row device[]{
        {"vkCreateAccelerationStructureKHR", DRIVER_FUNCTION(create)},
        {"vkCreateAccelerationStructure2KHR", DRIVER_FUNCTION(create2)},
        {"vkDestroyAccelerationStructureKHR", DRIVER_FUNCTION(destroy)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
    };
    return {device, {}};
}

} // namespace faults
