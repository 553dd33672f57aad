// SPDX-License-Identifier: Apache-2.0
// Buffers, types of memory and mappings. With the quirk "hostmemory" there is one type more; as long as
// VELLUM_TEST_SPY_MEMORY is in the environment, the others have nothing left.
#include "layers/spy.h"

#include <atomic>
#include <cstdlib>
#include <map>
#include <optional>
#include <utility>

namespace spy
{
namespace
{

std::optional<VkFlags64> usage2In(const void *chain)
{
    const auto *flags2 = static_cast<const VkBufferUsageFlags2CreateInfoKHR *>(
        inChain(chain, VK_STRUCTURE_TYPE_BUFFER_USAGE_FLAGS_2_CREATE_INFO_KHR));
    return flags2 != nullptr ? std::optional(flags2->usage) : std::nullopt;
}

void expectNoMicromapUsage(bool known, const char *where, VkBufferUsageFlags usage, const void *chain)
{
    if (!known && ((usage | usage2In(chain).value_or(0)) & (VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT |
                                                            VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT)) != 0)
        report(std::string(where) + ": micromap usage");
}

// Protected buffers, and those in tile memory, may have few usages.
void expectAllowedUsage(const char *where, const VkBufferCreateInfo &info)
{
    constexpr VkFlags64 kTileMemory = 0x08000000; // VK_BUFFER_USAGE_TILE_MEMORY_BIT_QCOM
    constexpr VkFlags64 kAllowed = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                   VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_TEXEL_BUFFER_BIT |
                                   VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                   VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const VkFlags64 usage = usage2In(info.pNext).value_or(info.usage);
    if ((info.flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && (usage & ~kAllowed) != 0)
        report(std::string(where) +
               ": usage that a protected buffer may not have (VUID-VkBufferCreateInfo-flags-09641)");
    if ((usage & kTileMemory) != 0 && (usage & ~(kAllowed | kTileMemory)) != 0)
        report(std::string(where) + ": usage that no tile memory may have (VUID-VkBufferCreateInfo-usage-10764)");
}

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    expectNoMicromapUsage(knowsMicromaps(keyOf(handle)), "vkCreateBuffer", info->usage, info->pNext);
    expectAllowedUsage("vkCreateBuffer", *info);
    return SPY_NEXT(vkCreateBuffer)(handle, info, allocator, buffer);
}

VKAPI_ATTR void VKAPI_CALL getDeviceBufferRequirements(VkDevice handle, const VkDeviceBufferMemoryRequirements *info,
                                                       VkMemoryRequirements2 *requirements)
{
    expectNoMicromapUsage(knowsMicromaps(keyOf(handle)), "vkGetDeviceBufferMemoryRequirements",
                          info->pCreateInfo->usage, info->pCreateInfo->pNext);
    expectAllowedUsage("vkGetDeviceBufferMemoryRequirements", *info->pCreateInfo);
    SPY_NEXT(vkGetDeviceBufferMemoryRequirements)(handle, info, requirements);
}

VKAPI_ATTR void VKAPI_CALL bindDescriptorBuffers(VkCommandBuffer handle, uint32_t count,
                                                 const VkDescriptorBufferBindingInfoEXT *infos)
{
    for (uint32_t i = 0; i < count; ++i)
        expectNoMicromapUsage(knowsMicromaps(keyOf(handle)), "vkCmdBindDescriptorBuffersEXT", infos[i].usage,
                              infos[i].pNext);
    SPY_NEXT(vkCmdBindDescriptorBuffersEXT)(handle, count, infos);
}

// --- a memory type more: that of the host, where lavapipe's are local to the device ---

bool moreMemory(void *key)
{
    return driver::has(key, "hostmemory");
}
uint32_t memoryTypesBelow = 0;

VKAPI_ATTR void VKAPI_CALL getBufferRequirements(VkDevice handle, VkBuffer buffer, VkMemoryRequirements *requirements)
{
    SPY_NEXT(vkGetBufferMemoryRequirements)(handle, buffer, requirements);
    if (moreMemory(keyOf(handle)))
        requirements->memoryTypeBits |= 1u << memoryTypesBelow;
}

std::atomic<uint64_t> allocations = 0;

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    VkMemoryAllocateInfo below = *info;
    if (moreMemory(keyOf(handle)) && info->memoryTypeIndex == memoryTypesBelow)
        below.memoryTypeIndex = 0;
    else if (std::getenv("VELLUM_TEST_SPY_MEMORY") != nullptr)
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    const VkResult result = SPY_NEXT(vkAllocateMemory)(handle, &below, allocator, memory);
    if (result == VK_SUCCESS)
        ++allocations;
    return result;
}

// Memory can be mapped once (VUID-vkMapMemory-memory-00678), and unmapped where it is
// (VUID-vkUnmapMemory-memory-00689).
std::map<VkDeviceMemory, bool> mapped;

void expectMapped(const char *where, VkDeviceMemory memory, bool before, bool after)
{
    bool was = false;
    {
        std::lock_guard lock(mutex);
        was = std::exchange(mapped[memory], after);
    }
    if (was != before)
        report(std::string(where) + (was ? ": memory that is mapped" : ": memory that is not mapped"));
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
                                         VkMemoryMapFlags flags, void **data)
{
    expectMapped("vkMapMemory", memory, false, true);
    return SPY_NEXT(vkMapMemory)(handle, memory, offset, size, flags, data);
}

struct MapInfo { // VkMemoryMapInfo
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkDeviceMemory memory;
    VkDeviceSize offset, size;
};

VKAPI_ATTR VkResult VKAPI_CALL mapMemory2(VkDevice handle, const MapInfo *info, void **data)
{
    expectMapped("vkMapMemory2", info->memory, false, true);
    return SPY_NEXT(vkMapMemory)(handle, info->memory, info->offset, info->size, info->flags, data);
}

VKAPI_ATTR void VKAPI_CALL unmapMemory(VkDevice handle, VkDeviceMemory memory)
{
    expectMapped("vkUnmapMemory", memory, true, false);
    SPY_NEXT(vkUnmapMemory)(handle, memory);
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        mapped.erase(memory);
    }
    if (memory != VK_NULL_HANDLE)
        --allocations;
    SPY_NEXT(vkFreeMemory)(handle, memory, allocator);
}

} // namespace

VKAPI_ATTR void VKAPI_CALL getExternalBuffers(VkPhysicalDevice handle, const VkPhysicalDeviceExternalBufferInfo *info,
                                              VkExternalBufferProperties *properties)
{
    expectNoMicromapUsage(driver::has(keyOf(handle), "ext"), "vkGetPhysicalDeviceExternalBufferProperties", info->usage,
                          info->pNext);
    SPY_NEXT(vkGetPhysicalDeviceExternalBufferProperties)(handle, info, properties);
}

VKAPI_ATTR void VKAPI_CALL getMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties *memory)
{
    SPY_NEXT(vkGetPhysicalDeviceMemoryProperties)(handle, memory);
    if (!moreMemory(keyOf(handle)))
        return;
    memoryTypesBelow = memory->memoryTypeCount;
    memory->memoryTypes[memory->memoryTypeCount++] = {
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT, 0};
}

std::span<const Row> memory()
{
    static const Row rows[]{
        {"vkGetBufferMemoryRequirements", SPY_FUNCTION(getBufferRequirements)},
        {"vkAllocateMemory", SPY_FUNCTION(allocateMemory)},
        {"vkMapMemory", SPY_FUNCTION(mapMemory)},
        {"vkMapMemory2", SPY_FUNCTION(mapMemory2)},
        {"vkUnmapMemory", SPY_FUNCTION(unmapMemory)},
        {"vkFreeMemory", SPY_FUNCTION(freeMemory)},
        {"vkCreateBuffer", SPY_FUNCTION(createBuffer)},
        {"vkGetDeviceBufferMemoryRequirements", SPY_FUNCTION(getDeviceBufferRequirements)},
        {"vkCmdBindDescriptorBuffersEXT", DRIVER_FUNCTION(bindDescriptorBuffers)},
    };
    return rows;
}

} // namespace spy

// Tests look this up in the library: the number of current allocations of device memory, by the layer and the tests.
extern "C" __attribute__((visibility("default"))) uint64_t vellumSpyAllocations();
extern "C" uint64_t vellumSpyAllocations()
{
    return spy::allocations;
}
