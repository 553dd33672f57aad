// SPDX-License-Identifier: Apache-2.0
// Garbage wherever a driver may leave it: the quirks "dirty" and "scratch". Lavapipe's memory begins as zeros, as that
// of other drivers need not, and its builds leave most of their scratch memory as it was.
#include "layers/driver.h"

#include <cstring>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Garbage;

// --- "dirty": memory with the content of an earlier user ---

constexpr uint8_t kOthers = 0xd7;
constexpr VkDeviceSize kMostDirt = VkDeviceSize{64} << 20; // of one allocation

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const VkResult result = DRIVER_NEXT(vkAllocateMemory)(handle, info, allocator, memory);
    // Imported memory has its owner's content.
    const bool imported = inChain(info->pNext, VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT) != nullptr ||
                          inChain(info->pNext, VK_STRUCTURE_TYPE_IMPORT_MEMORY_FD_INFO_KHR) != nullptr;
    if (result != VK_SUCCESS || imported || !has(keyOf(handle), "dirty"))
        return result;
    void *data = nullptr;
    if (DRIVER_NEXT(vkMapMemory)(handle, *memory, 0, VK_WHOLE_SIZE, 0, &data) == VK_SUCCESS) {
        std::memset(data, kOthers, std::min(info->allocationSize, kMostDirt));
        DRIVER_NEXT(vkUnmapMemory)(handle, *memory);
    }
    return result;
}

// --- "scratch": builds that need more of it, and write to all of it ---

constexpr uint32_t kScratch = 0xabababab;

AddressedBuffers buffers; // that may be scratch memory

bool takesMore(void *key)
{
    return has(key, "scratch");
}

void claim(VkAccelerationStructureBuildSizesInfoKHR &needed)
{
    needed.buildScratchSize = needed.buildScratchSize * 2 + 1000;
    // More than a build needs: it is unknown which is larger.
    needed.updateScratchSize = needed.buildScratchSize + 3000;
}

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    constexpr VkBufferUsageFlags scratch =
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    if (takesMore(keyOf(handle)) && (info->usage & scratch) == scratch)
        return buffers.create(kLevel, handle, *info, allocator, buffer);
    return DRIVER_NEXT(vkCreateBuffer)(handle, info, allocator, buffer);
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    buffers.forget(buffer);
    DRIVER_NEXT(vkDestroyBuffer)(handle, buffer, allocator);
}

void noteBound(VkDevice handle, VkBuffer buffer)
{
    if (!buffers.has(buffer))
        return;
    auto info = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer});
    buffers.setAddress(handle, buffer, DRIVER_NEXT(vkGetBufferDeviceAddress)(handle, &info));
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice handle, VkBuffer buffer, VkDeviceMemory memory,
                                                VkDeviceSize offset)
{
    const VkResult result = DRIVER_NEXT(vkBindBufferMemory)(handle, buffer, memory, offset);
    noteBound(handle, buffer);
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice handle, uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    const VkResult result = DRIVER_NEXT(vkBindBufferMemory2)(handle, count, infos);
    for (const VkBindBufferMemoryInfo &info : std::span(infos, count))
        noteBound(handle, info.buffer);
    return result;
}

VKAPI_ATTR void VKAPI_CALL getBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                         const uint32_t *counts, VkAccelerationStructureBuildSizesInfoKHR *needed)
{
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)(handle, type, info, counts, needed);
    if (takesMore(keyOf(handle)))
        claim(*needed);
}

// Fills all of the scratch memory of a build before it begins.
void writeGarbage(VkCommandBuffer handle, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                  const std::vector<uint32_t> &counts)
{
    auto needed = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)
    (deviceOf(keyOf(handle)), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, counts.data(), &needed);
    claim(needed);
    const VkDeviceSize bytes = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR ? needed.updateScratchSize
                                                                                            : needed.buildScratchSize;
    const VkDeviceAddress address = info.scratchData.deviceAddress;
    const AddressedBuffers::Found found = buffers.find(handle, address, bytes);
    if (found.buffer == VK_NULL_HANDLE)
        return report("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03671 or -03672: no buffer has the " +
                      std::to_string(bytes) + " bytes of scratch memory at " + std::to_string(address));
    DRIVER_NEXT(vkCmdFillBuffer)(handle, found.buffer, found.offset, bytes & ~VkDeviceSize{3}, kScratch);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    for (uint32_t i = 0; takesMore(keyOf(handle)) && i < count; ++i) {
        std::vector<uint32_t> counts;
        for (const auto &range : std::span(ranges[i], infos[i].geometryCount))
            counts.push_back(range.primitiveCount);
        writeGarbage(handle, infos[i], counts);
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    for (uint32_t i = 0; takesMore(keyOf(handle)) && i < count; ++i)
        writeGarbage(handle, infos[i], {most[i], most[i] + infos[i].geometryCount});
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresIndirectKHR)(handle, count, infos, addresses, strides, most);
}

} // namespace

driver::LevelRows driver::garbageRows()
{
    static const Row device[]{
        {"vkAllocateMemory", DRIVER_FUNCTION(allocateMemory)},
        {"vkCreateBuffer", DRIVER_FUNCTION(createBuffer)},
        {"vkDestroyBuffer", DRIVER_FUNCTION(destroyBuffer)},
        {"vkBindBufferMemory", DRIVER_FUNCTION(bindBufferMemory)},
        {"vkBindBufferMemory2", DRIVER_FUNCTION(bindBufferMemory2)},
        {"vkGetAccelerationStructureBuildSizesKHR", DRIVER_FUNCTION(getBuildSizes)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(cmdBuildIndirect)},
    };
    return {device, {}};
}
