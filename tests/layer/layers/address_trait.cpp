// The trait "elsewhere": all memory with device addresses is mapped twice. Buffers are at the first place; structures
// say that they are at the second one, and the host's mappings are there. Both work on lavapipe, as on a GPU where they
// differ.
#include "layers/imported_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <map>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Addresses;

struct TwoPlaces {
    std::uint8_t *first = nullptr, *second = nullptr;
    std::size_t bytes = 0;
};
struct Structure {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkAccelerationStructureTypeKHR type{};
};

std::mutex mutex;
std::map<VkDeviceMemory, TwoPlaces> memories;
std::map<VkBuffer, VkDeviceMemory> bindings;
std::map<VkAccelerationStructureKHR, Structure> structures;

void unmap(const TwoPlaces &places)
{
    for (void *place : {places.first, places.second}) {
        if (place != nullptr)
            munmap(place, places.bytes);
    }
}

TwoPlaces mapTwice(std::size_t bytes)
{
    const int file = memfd_create("vellum test driver", MFD_CLOEXEC);
    TwoPlaces places{.bytes = bytes};
    if (file < 0)
        return {};
    if (ftruncate(file, static_cast<off_t>(bytes)) == 0) {
        for (std::uint8_t **place : {&places.first, &places.second}) {
            void *mapped = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
            *place = mapped == MAP_FAILED ? nullptr : static_cast<std::uint8_t *>(mapped);
        }
    }
    close(file);
    if (places.first != nullptr && places.second != nullptr)
        return places;
    unmap(places);
    return {};
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
    const TwoPlaces places = mapTwice(importedBytes(info->allocationSize));
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

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice handle, std::uint32_t count,
                                                 const VkBindBufferMemoryInfo *infos)
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
        structures[*structure] = {info->buffer, info->type};
    return result;
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL structureAddress(VkDevice handle,
                                                       const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    const VkDeviceAddress address = DRIVER_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, info);
    std::lock_guard lock(mutex);
    const Structure &known = structures[info->accelerationStructure];
    // Of these it is as far from another one's of the same buffer as their offsets are, and may be the buffer's.
    if (known.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        return address;
    const auto places = memories.find(bindings[known.buffer]);
    return places == memories.end() ? address
                                    : address + reinterpret_cast<std::uint64_t>(places->second.second) -
                                          reinterpret_cast<std::uint64_t>(places->second.first);
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
        {"vkGetAccelerationStructureDeviceAddressKHR", DRIVER_FUNCTION(structureAddress)},
    };
    static const Row instance[]{{"vkCreateDevice", DRIVER_FUNCTION(createDevice)}};
    return {device, instance};
}
