// SPDX-License-Identifier: Apache-2.0
// The quirks "discrete", "window" and "uncached": memory types with restrictions, where lavapipe has one for
// everything. Memory that is not host-visible cannot be mapped, memory that is not coherent needs flushes, and a heap
// has no more than its size.
#include "layers/driver.h"

#include <cstring>
#include <map>
#include <memory>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Memory;

constexpr VkMemoryPropertyFlags kLocal = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
constexpr VkMemoryPropertyFlags kVisible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
constexpr VkMemoryPropertyFlags kCoherent = VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
constexpr VkMemoryPropertyFlags kCached = VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
constexpr VkMemoryPropertyFlags kUncached =
    VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD | VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD;
constexpr VkDeviceSize kMiB = VkDeviceSize{1} << 20;

struct Memories {
    std::vector<VkMemoryType> types;
    std::vector<VkMemoryHeap> heaps;
};

const Memories &memoriesOf(void *key)
{
    // Types are in the order that VkPhysicalDeviceMemoryProperties demands: those with fewer properties come first, and
    // those of AMD's last.
    static const Memories discrete{
        {{kLocal, 0}, {kVisible | kCached, 1}, {kVisible | kCoherent, 1}, {kVisible | kCoherent | kCached, 1}},
        {{8192 * kMiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT}, {8192 * kMiB, 0}}};
    static const Memories window{{{kLocal, 0},
                                  {kVisible | kCoherent, 2},
                                  {kVisible | kCoherent | kCached, 2},
                                  {kLocal | kVisible | kCoherent, 1}},
                                 {{8192 * kMiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT},
                                  {256 * kMiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT},
                                  {8192 * kMiB, 0}}};
    static const Memories uncached{{{kLocal, 0},
                                    {kVisible | kCoherent, 1},
                                    {kVisible | kCoherent | kCached, 1},
                                    {kLocal | kVisible | kCoherent | kUncached, 0}},
                                   {{8192 * kMiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT}, {8192 * kMiB, 0}}};
    return has(key, "window") ? window : has(key, "uncached") ? uncached : discrete;
}

VKAPI_ATTR void VKAPI_CALL getMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties *memory)
{
    const Memories &own = memoriesOf(keyOf(handle));
    *memory = {};
    memory->memoryTypeCount = static_cast<uint32_t>(own.types.size());
    memory->memoryHeapCount = static_cast<uint32_t>(own.heaps.size());
    std::copy(own.types.begin(), own.types.end(), memory->memoryTypes);
    std::copy(own.heaps.begin(), own.heaps.end(), memory->memoryHeaps);
}

VKAPI_ATTR void VKAPI_CALL getMemoryProperties2(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties2 *memory)
{
    getMemoryProperties(handle, &memory->memoryProperties);
}

// --- what may be bound to which type: everything to every one ---

template <class Handle>
void widen(Handle handle, VkMemoryRequirements &requirements)
{
    requirements.memoryTypeBits = (1u << memoriesOf(keyOf(handle)).types.size()) - 1;
}

template <class Object>
VKAPI_ATTR void VKAPI_CALL getRequirements(VkDevice handle, Object object, VkMemoryRequirements *requirements)
{
    if constexpr (std::is_same_v<Object, VkBuffer>)
        DRIVER_NEXT(vkGetBufferMemoryRequirements)(handle, object, requirements);
    else
        DRIVER_NEXT(vkGetImageMemoryRequirements)(handle, object, requirements);
    widen(handle, *requirements);
}

VKAPI_ATTR void VKAPI_CALL getBufferRequirements2(VkDevice handle, const VkBufferMemoryRequirementsInfo2 *info,
                                                  VkMemoryRequirements2 *requirements)
{
    DRIVER_NEXT(vkGetBufferMemoryRequirements2)(handle, info, requirements);
    widen(handle, requirements->memoryRequirements);
}

VKAPI_ATTR void VKAPI_CALL getImageRequirements2(VkDevice handle, const VkImageMemoryRequirementsInfo2 *info,
                                                 VkMemoryRequirements2 *requirements)
{
    DRIVER_NEXT(vkGetImageMemoryRequirements2)(handle, info, requirements);
    widen(handle, requirements->memoryRequirements);
}

VKAPI_ATTR void VKAPI_CALL getDeviceBufferRequirements(VkDevice handle, const VkDeviceBufferMemoryRequirements *info,
                                                       VkMemoryRequirements2 *requirements)
{
    DRIVER_NEXT(vkGetDeviceBufferMemoryRequirements)(handle, info, requirements);
    widen(handle, requirements->memoryRequirements);
}

VKAPI_ATTR void VKAPI_CALL getDeviceImageRequirements(VkDevice handle, const VkDeviceImageMemoryRequirements *info,
                                                      VkMemoryRequirements2 *requirements)
{
    DRIVER_NEXT(vkGetDeviceImageMemoryRequirements)(handle, info, requirements);
    widen(handle, requirements->memoryRequirements);
}

VKAPI_ATTR VkResult VKAPI_CALL getHostPointerProperties(VkDevice handle, VkExternalMemoryHandleTypeFlagBits type,
                                                        const void *pointer,
                                                        VkMemoryHostPointerPropertiesEXT *properties)
{
    const VkResult result = DRIVER_NEXT(vkGetMemoryHostPointerPropertiesEXT)(handle, type, pointer, properties);
    const Memories &own = memoriesOf(keyOf(handle));
    properties->memoryTypeBits = 0;
    for (uint32_t i = 0; i < own.types.size(); ++i) {
        if ((own.types[i].propertyFlags & (kLocal | kVisible)) == kVisible)
            properties->memoryTypeBits |= 1u << i;
    }
    return result;
}

// --- allocations and mappings ---

struct Allocation {
    void *device = nullptr; // key
    uint32_t type = 0, heap = 0;
    VkDeviceSize bytes = 0;
    VkMemoryPropertyFlags flags = 0;
    uint8_t *real = nullptr; // where it is mapped
    // The host's copy of memory that is not coherent: writes become visible to the other side only by a flush or an
    // invalidation. A read without one returns this pattern.
    std::unique_ptr<std::vector<uint8_t>> host;
};
constexpr uint8_t kNeverInvalidated = 0xcd;

std::mutex mutex;
std::map<VkDeviceMemory, Allocation> allocations;
std::map<std::pair<void *, uint32_t>, VkDeviceSize> used; // by device and heap

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const Memories &own = memoriesOf(keyOf(handle));
    if (info->memoryTypeIndex >= own.types.size()) {
        report("vkAllocateMemory: there is no memory type " + std::to_string(info->memoryTypeIndex));
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    const VkMemoryType &type = own.types[info->memoryTypeIndex];
    const VkMemoryHeap &heap = own.heaps[type.heapIndex];
    if (info->allocationSize > heap.size) {
        report("VUID-vkAllocateMemory-pAllocateInfo-01713: " + std::to_string(info->allocationSize) +
               " bytes of a heap of " + std::to_string(heap.size));
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    if ((type.propertyFlags & kUncached) != 0) {
        report("VUID-vkAllocateMemory-deviceCoherentMemory-02790: the feature was not enabled");
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    {
        std::lock_guard lock(mutex);
        VkDeviceSize &inHeap = used[{keyOf(handle), type.heapIndex}];
        if (info->allocationSize > heap.size - inHeap)
            return VK_ERROR_OUT_OF_DEVICE_MEMORY;
        inHeap += info->allocationSize;
    }
    VkMemoryAllocateInfo below = *info;
    below.memoryTypeIndex = 0;
    const VkResult result = DRIVER_NEXT(vkAllocateMemory)(handle, &below, allocator, memory);
    std::lock_guard lock(mutex);
    if (result != VK_SUCCESS) {
        used[{keyOf(handle), type.heapIndex}] -= info->allocationSize;
        return result;
    }
    Allocation &made = allocations[*memory];
    made = {
        keyOf(handle), info->memoryTypeIndex, type.heapIndex, info->allocationSize, type.propertyFlags, nullptr, {}};
    if ((type.propertyFlags & (kVisible | kCoherent)) == kVisible)
        made.host = std::make_unique<std::vector<uint8_t>>(info->allocationSize, kNeverInvalidated);
    return result;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        if (const auto gone = allocations.extract(memory))
            used[{gone.mapped().device, gone.mapped().heap}] -= gone.mapped().bytes;
    }
    DRIVER_NEXT(vkFreeMemory)(handle, memory, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
                                         VkMemoryMapFlags flags, void **data)
{
    std::lock_guard lock(mutex);
    Allocation &known = allocations[memory];
    if ((known.flags & kVisible) == 0) {
        report("VUID-vkMapMemory-memory-00682: the memory is not host-visible");
        return VK_ERROR_MEMORY_MAP_FAILED;
    }
    if (!known.host)
        return DRIVER_NEXT(vkMapMemory)(handle, memory, offset, size, flags, data);
    void *real = nullptr;
    const VkResult result = DRIVER_NEXT(vkMapMemory)(handle, memory, 0, VK_WHOLE_SIZE, flags, &real);
    known.real = static_cast<uint8_t *>(real);
    if (result == VK_SUCCESS)
        *data = known.host->data() + offset;
    return result;
}

struct MapInfo { // VkMemoryMapInfo, which older headers lack
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkDeviceMemory memory;
    VkDeviceSize offset, size;
};

VKAPI_ATTR VkResult VKAPI_CALL mapMemory2(VkDevice handle, const MapInfo *info, void **data)
{
    return mapMemory(handle, info->memory, info->offset, info->size, info->flags, data);
}

// Copies between the host's view of memory that is not coherent, and the device's.
VkResult move(VkDevice handle, const char *command, uint32_t count, const VkMappedMemoryRange *ranges, bool toDevice)
{
    const VkDeviceSize atom = has(keyOf(handle), "alignments") ? 256 : 64; // limits_quirk.cpp, or lavapipe's own
    std::lock_guard lock(mutex);
    for (const VkMappedMemoryRange &range : std::span(ranges, count)) {
        const Allocation &known = allocations[range.memory];
        const VkDeviceSize end = range.size == VK_WHOLE_SIZE ? known.bytes : range.offset + range.size;
        if (range.offset % atom != 0 || (end % atom != 0 && end != known.bytes) || end > known.bytes)
            report(std::string(command) + ": VUID-VkMappedMemoryRange-offset-00687 or -size-01390");
        else if (known.real == nullptr)
            report(std::string(command) + ": VUID-VkMappedMemoryRange-memory-00684: memory that is not mapped");
        else if (known.host) {
            uint8_t *host = known.host->data() + range.offset;
            uint8_t *device = known.real + range.offset;
            std::memcpy(toDevice ? device : host, toDevice ? host : device, end - range.offset);
        }
    }
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL flush(VkDevice handle, uint32_t count, const VkMappedMemoryRange *ranges)
{
    return move(handle, "vkFlushMappedMemoryRanges", count, ranges, true);
}

VKAPI_ATTR VkResult VKAPI_CALL invalidate(VkDevice handle, uint32_t count, const VkMappedMemoryRange *ranges)
{
    return move(handle, "vkInvalidateMappedMemoryRanges", count, ranges, false);
}

} // namespace

driver::LevelRows driver::memoryRows()
{
    static const Row device[]{
        {"vkGetBufferMemoryRequirements", DRIVER_FUNCTION(getRequirements<VkBuffer>)},
        {"vkGetImageMemoryRequirements", DRIVER_FUNCTION(getRequirements<VkImage>)},
        {"vkGetBufferMemoryRequirements2", DRIVER_FUNCTION(getBufferRequirements2)},
        {"vkGetImageMemoryRequirements2", DRIVER_FUNCTION(getImageRequirements2)},
        {"vkGetDeviceBufferMemoryRequirements", DRIVER_FUNCTION(getDeviceBufferRequirements)},
        {"vkGetDeviceImageMemoryRequirements", DRIVER_FUNCTION(getDeviceImageRequirements)},
        {"vkGetMemoryHostPointerPropertiesEXT", DRIVER_FUNCTION(getHostPointerProperties)},
        {"vkAllocateMemory", DRIVER_FUNCTION(allocateMemory)},
        {"vkFreeMemory", DRIVER_FUNCTION(freeMemory)},
        {"vkMapMemory", DRIVER_FUNCTION(mapMemory)},
        {"vkMapMemory2", DRIVER_FUNCTION(mapMemory2)},
        {"vkFlushMappedMemoryRanges", DRIVER_FUNCTION(flush)},
        {"vkInvalidateMappedMemoryRanges", DRIVER_FUNCTION(invalidate)},
    };
    static const Row instance[]{
        {"vkGetPhysicalDeviceMemoryProperties", DRIVER_FUNCTION(getMemoryProperties)},
        {"vkGetPhysicalDeviceMemoryProperties2", DRIVER_FUNCTION(getMemoryProperties2)},
    };
    return {device, instance};
}
