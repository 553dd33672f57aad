// SPDX-License-Identifier: Apache-2.0
// The quirk "replay": memory with VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT is at the requested address, or
// at a random one, and host memory cannot be imported (except by this layer). With "capable", which has the feature.
#include "layers/imported_memory.h"

#include <sys/mman.h>

#include <map>
#include <random>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Replay;

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [](std::vector<VkExtensionProperties> &all) {
        std::erase_if(
            all, [](const VkExtensionProperties &e) { return std::strcmp(e.extensionName, kImportExtension) == 0; });
    });
}

struct Mapping {
    void *data = nullptr;
    size_t bytes = 0;
};
std::mutex mutex;
std::map<VkDeviceMemory, Mapping> mappings;

void *mapAt(uint64_t address, size_t bytes)
{
    void *wanted = reinterpret_cast<void *>(address);
    void *got = mmap(wanted, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0);
    if (got != MAP_FAILED && got != wanted)
        munmap(got, bytes);
    return got == wanted ? got : nullptr;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const auto *flags = inChain<VkMemoryAllocateFlagsInfo>(info->pNext, VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    if (flags == nullptr || (flags->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT) == 0)
        return DRIVER_NEXT(vkAllocateMemory)(handle, info, allocator, memory);
    const auto *opaque = inChain<VkMemoryOpaqueCaptureAddressAllocateInfo>(
        info->pNext, VK_STRUCTURE_TYPE_MEMORY_OPAQUE_CAPTURE_ADDRESS_ALLOCATE_INFO);
    Mapping mapping{nullptr, importedBytes(info->allocationSize)};
    if (opaque != nullptr && opaque->opaqueCaptureAddress != 0) {
        mapping.data = mapAt(opaque->opaqueCaptureAddress, mapping.bytes);
        if (mapping.data == nullptr)
            return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    std::random_device random;
    while (mapping.data == nullptr)
        mapping.data = mapAt(0x300000000000u + (uint64_t{random()} << 12), mapping.bytes);
    const VkResult result = importMemory(kLevel, handle, *info, mapping.data, allocator, memory);
    if (result != VK_SUCCESS) {
        munmap(mapping.data, mapping.bytes);
        return result;
    }
    std::lock_guard lock(mutex);
    mappings[*memory] = mapping;
    return result;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    DRIVER_NEXT(vkFreeMemory)(handle, memory, allocator);
    std::lock_guard lock(mutex);
    if (const auto found = mappings.extract(memory))
        munmap(found.mapped().data, found.mapped().bytes);
}

VKAPI_ATTR uint64_t VKAPI_CALL opaqueOfBuffer(VkDevice handle, const VkBufferDeviceAddressInfo *info)
{
    return DRIVER_NEXT(vkGetBufferDeviceAddress)(handle, info);
}

VKAPI_ATTR uint64_t VKAPI_CALL opaqueOfMemory(VkDevice, const VkDeviceMemoryOpaqueCaptureAddressInfo *info)
{
    std::lock_guard lock(mutex);
    return reinterpret_cast<uint64_t>(mappings[info->memory].data);
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    return createDeviceWithImport(kLevel, handle, *info, allocator, device);
}

} // namespace

driver::LevelRows driver::replayRows()
{
    static const Row device[]{
        {"vkAllocateMemory", DRIVER_FUNCTION(allocateMemory)},
        {"vkFreeMemory", DRIVER_FUNCTION(freeMemory)},
        {"vkGetBufferOpaqueCaptureAddress", DRIVER_FUNCTION(opaqueOfBuffer)},
        {"vkGetDeviceMemoryOpaqueCaptureAddress", DRIVER_FUNCTION(opaqueOfMemory)},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
    };
    return {device, instance};
}
