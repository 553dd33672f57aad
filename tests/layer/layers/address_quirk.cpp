// SPDX-License-Identifier: Apache-2.0
// The quirk "elsewhere": all memory with device addresses is mapped twice. Buffers are at the first place, the host's
// mappings at the second one. Structures say that they are at a third one, which there is as long as one of that memory
// lives whose address was queried; then structures of other memory get it. All of them work on lavapipe, as on a
// GPU where they differ.
#include "layers/imported_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <map>
#include <utility>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Addresses;

struct Places {
    uint8_t *first = nullptr, *second = nullptr;
    size_t bytes = 0;
    int file = -1;
    uint8_t *third = nullptr;
    uint32_t structures = 0; // at the third place
};
struct Structure {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkAccelerationStructureTypeKHR type{};
    VkDeviceMemory thirdPlaceOf = VK_NULL_HANDLE;
};

std::mutex mutex;
std::map<VkDeviceMemory, Places> memories;
std::map<VkBuffer, VkDeviceMemory> bindings;
std::map<VkAccelerationStructureKHR, Structure> structures;
std::multimap<size_t, uint8_t *> freeThirdPlaces; // by their bytes; the next one that is needed is the last

void unmap(const Places &places)
{
    for (void *place : {places.first, places.second, places.third}) {
        if (place != nullptr)
            munmap(place, places.bytes);
    }
    if (places.file >= 0)
        close(places.file);
}

uint8_t *mapAt(uint8_t *at, const Places &places)
{
    void *mapped =
        mmap(at, places.bytes, PROT_READ | PROT_WRITE, MAP_SHARED | (at != nullptr ? MAP_FIXED : 0), places.file, 0);
    return mapped == MAP_FAILED ? nullptr : static_cast<uint8_t *>(mapped);
}

Places mapTwice(size_t bytes)
{
    Places places{.bytes = bytes, .file = memfd_create("vellum mock driver", MFD_CLOEXEC)};
    if (places.file >= 0 && ftruncate(places.file, static_cast<off_t>(bytes)) == 0) {
        places.first = mapAt(nullptr, places);
        places.second = mapAt(nullptr, places);
    }
    if (places.first != nullptr && places.second != nullptr)
        return places;
    unmap(places);
    return {};
}

// Requires the mutex to be locked. Returns null if no space is left.
uint8_t *thirdPlace(Places &places)
{
    if (places.third != nullptr)
        return places.third;
    uint8_t *free = nullptr;
    if (auto last = freeThirdPlaces.upper_bound(places.bytes); last != freeThirdPlaces.begin()) {
        --last;
        if (last->first == places.bytes) {
            free = last->second;
            freeThirdPlaces.erase(last);
        }
    }
    return places.third = mapAt(free, places);
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const auto *flags = inChain<VkMemoryAllocateFlagsInfo>(info->pNext, VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    const bool addressed = flags != nullptr && (flags->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT) != 0;
    const bool placed = flags != nullptr && (flags->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT) != 0;
    const bool imported = inChain(info->pNext, VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT) != nullptr;
    if (!addressed || placed || imported)
        return DRIVER_NEXT(vkAllocateMemory)(handle, info, allocator, memory);
    const Places places = mapTwice(importedBytes(info->allocationSize));
    if (places.first == nullptr)
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    const VkResult result = importMemory(kLevel, handle, *info, places.first, allocator, memory);
    if (result != VK_SUCCESS) {
        unmap(places);
        return result;
    }
    std::lock_guard lock(mutex);
    memories[*memory] = places;
    return result;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    DRIVER_NEXT(vkFreeMemory)(handle, memory, allocator);
    std::lock_guard lock(mutex);
    if (const auto gone = memories.extract(memory))
        unmap(gone.mapped());
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
                                         VkMemoryMapFlags flags, void **data)
{
    const VkResult result = DRIVER_NEXT(vkMapMemory)(handle, memory, offset, size, flags, data);
    std::lock_guard lock(mutex);
    const auto known = memories.find(memory);
    if (result == VK_SUCCESS && known != memories.end())
        *data = known->second.second + offset;
    return result;
}

void bind(VkBuffer buffer, VkDeviceMemory memory)
{
    std::lock_guard lock(mutex);
    bindings[buffer] = memory;
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice handle, VkBuffer buffer, VkDeviceMemory memory,
                                                VkDeviceSize offset)
{
    bind(buffer, memory);
    return DRIVER_NEXT(vkBindBufferMemory)(handle, buffer, memory, offset);
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice handle, uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    for (const VkBindBufferMemoryInfo &info : std::span(infos, count))
        bind(info.buffer, info.memory);
    return DRIVER_NEXT(vkBindBufferMemory2)(handle, count, infos);
}

VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *allocator,
                                               VkAccelerationStructureKHR *structure)
{
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructureKHR)(handle, info, allocator, structure);
    std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        structures[*structure] = {info->buffer, info->type, VK_NULL_HANDLE};
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        const auto gone = structures.extract(structure);
        const auto places = gone ? memories.find(gone.mapped().thirdPlaceOf) : memories.end();
        if (places != memories.end() && --places->second.structures == 0)
            freeThirdPlaces.emplace(places->second.bytes, std::exchange(places->second.third, nullptr));
    }
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL structureAddress(VkDevice handle,
                                                       const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    const VkDeviceAddress address = DRIVER_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, info);
    std::lock_guard lock(mutex);
    Structure &known = structures[info->accelerationStructure];
    // The address of such a structure must be its buffer's plus its offset, so it is not changed.
    if (known.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        return address;
    const VkDeviceMemory memory = bindings[known.buffer];
    const auto places = memories.find(memory);
    if (places == memories.end() || thirdPlace(places->second) == nullptr)
        return address;
    if (known.thirdPlaceOf == VK_NULL_HANDLE)
        ++places->second.structures;
    known.thirdPlaceOf = memory;
    return address + reinterpret_cast<uint64_t>(places->second.third) -
           reinterpret_cast<uint64_t>(places->second.first);
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    return createDeviceWithImport(kLevel, handle, *info, allocator, device);
}

} // namespace

driver::LevelRows driver::addressRows()
{
    static const Row device[]{
        {"vkAllocateMemory", DRIVER_FUNCTION(allocateMemory)},
        {"vkFreeMemory", DRIVER_FUNCTION(freeMemory)},
        {"vkMapMemory", DRIVER_FUNCTION(mapMemory)},
        {"vkBindBufferMemory", DRIVER_FUNCTION(bindBufferMemory)},
        {"vkBindBufferMemory2", DRIVER_FUNCTION(bindBufferMemory2)},
        {"vkCreateAccelerationStructureKHR", DRIVER_FUNCTION(createStructure)},
        {"vkDestroyAccelerationStructureKHR", DRIVER_FUNCTION(destroyStructure)},
        {"vkGetAccelerationStructureDeviceAddressKHR", DRIVER_FUNCTION(structureAddress)},
    };
    static const Row instance[]{{"vkCreateDevice", DRIVER_FUNCTION(createDevice)}};
    return {device, instance};
}
