// A layer for the tests, below Vellum's: it makes a driver with features that lavapipe lacks out of lavapipe, whose
// device addresses are the host's.
//   - accelerationStructureIndirectBuild: the ranges are read when the build is recorded, and built directly.
//   - bufferDeviceAddressCaptureReplay: buffers and memory take the flags, and are where they happen to be. Where
//     VELLUM_TEST_CAPABLE_REPLAY is in the environment, it is a driver that really replays: memory with the flag is at
//     the address that was asked for, or at a random one, and host memory cannot be imported (but by this layer).
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <vector>

namespace
{

std::mutex mutex;
// Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
struct InstanceTable {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr get = nullptr;
    PFN_vkGetPhysicalDeviceFeatures2 getFeatures2 = nullptr;
    PFN_vkEnumerateDeviceExtensionProperties enumerateExtensions = nullptr;
};
std::map<void *, InstanceTable> instances;
std::map<void *, std::pair<VkDevice, PFN_vkGetDeviceProcAddr>> devices;

template <class Handle>
void *keyOf(Handle handle)
{
    return *reinterpret_cast<void **>(handle);
}

InstanceTable tableOf(void *key)
{
    std::lock_guard lock(mutex);
    return instances.at(key);
}

template <class Function, class Handle>
Function nextOfDevice(Handle handle, const char *name)
{
    std::lock_guard lock(mutex);
    const auto &[device, get] = devices.at(keyOf(handle));
    return reinterpret_cast<Function>(get(device, name));
}

template <class T>
T *inChain(const void *chain, VkStructureType type)
{
    auto *structure = static_cast<VkBaseOutStructure *>(const_cast<void *>(chain));
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    return reinterpret_cast<T *>(structure);
}

// The features of this layer, in whatever structures a chain has them.
void setFeatures(const void *chain, VkBool32 value)
{
    if (auto *f = inChain<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR))
        f->accelerationStructureIndirectBuild = value;
    if (auto *f = inChain<VkPhysicalDeviceBufferDeviceAddressFeatures>(
            chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES))
        f->bufferDeviceAddressCaptureReplay = value;
    if (auto *f =
            inChain<VkPhysicalDeviceVulkan12Features>(chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES))
        f->bufferDeviceAddressCaptureReplay = value;
}

VKAPI_ATTR void VKAPI_CALL getFeatures2(VkPhysicalDevice physical, VkPhysicalDeviceFeatures2 *features)
{
    tableOf(keyOf(physical)).getFeatures2(physical, features);
    setFeatures(features->pNext, VK_TRUE);
}

// --- replay ---

bool replays()
{
    static const bool wanted = std::getenv("VELLUM_TEST_CAPABLE_REPLAY") != nullptr;
    return wanted;
}

constexpr const char *kImport = VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME;

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice physical, const char *layer, std::uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    const auto next = tableOf(keyOf(physical)).enumerateExtensions;
    if (layer != nullptr || !replays())
        return next(physical, layer, count, properties);
    std::uint32_t below = 0;
    next(physical, nullptr, &below, nullptr);
    std::vector<VkExtensionProperties> all(below);
    next(physical, nullptr, &below, all.data());
    std::erase_if(all, [](const VkExtensionProperties &e) { return std::strcmp(e.extensionName, kImport) == 0; });
    const auto size = static_cast<std::uint32_t>(all.size());
    if (properties == nullptr) {
        *count = size;
        return VK_SUCCESS;
    }
    *count = std::min(*count, size);
    std::copy_n(all.begin(), *count, properties);
    return *count < size ? VK_INCOMPLETE : VK_SUCCESS;
}

struct Mapping {
    void *data = nullptr;
    std::size_t bytes = 0;
};
std::map<VkDeviceMemory, Mapping> mappings;

void *mapAt(std::uint64_t address, std::size_t bytes)
{
    void *wanted = reinterpret_cast<void *>(address);
    void *got = mmap(wanted, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0);
    if (got != MAP_FAILED && got != wanted)
        munmap(got, bytes);
    return got == wanted ? got : nullptr;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice device, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const auto next = nextOfDevice<PFN_vkAllocateMemory>(device, "vkAllocateMemory");
    const auto *flags = inChain<VkMemoryAllocateFlagsInfo>(info->pNext, VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    if (!replays() || flags == nullptr || (flags->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT) == 0)
        return next(device, info, allocator, memory);
    const auto *opaque = inChain<VkMemoryOpaqueCaptureAddressAllocateInfo>(
        info->pNext, VK_STRUCTURE_TYPE_MEMORY_OPAQUE_CAPTURE_ADDRESS_ALLOCATE_INFO);
    Mapping mapping{nullptr, (info->allocationSize + 0xffff) & ~std::size_t{0xffff}};
    if (opaque != nullptr && opaque->opaqueCaptureAddress != 0) {
        mapping.data = mapAt(opaque->opaqueCaptureAddress, mapping.bytes);
        if (mapping.data == nullptr)
            return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    std::random_device random;
    while (mapping.data == nullptr)
        mapping.data = mapAt(0x300000000000u + (std::uint64_t{random()} << 12), mapping.bytes);
    const VkImportMemoryHostPointerInfoEXT import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT, nullptr,
                                                  VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT, mapping.data};
    const VkMemoryAllocateFlagsInfo plainFlags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, &import,
                                               VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT, 0};
    const VkMemoryAllocateInfo below{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &plainFlags, mapping.bytes,
                                     info->memoryTypeIndex};
    const VkResult result = next(device, &below, allocator, memory);
    if (result != VK_SUCCESS) {
        munmap(mapping.data, mapping.bytes);
        return result;
    }
    std::lock_guard lock(mutex);
    mappings[*memory] = mapping;
    return result;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice device, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    nextOfDevice<PFN_vkFreeMemory>(device, "vkFreeMemory")(device, memory, allocator);
    std::lock_guard lock(mutex);
    if (const auto found = mappings.extract(memory))
        munmap(found.mapped().data, found.mapped().bytes);
}

VKAPI_ATTR std::uint64_t VKAPI_CALL opaqueOfBuffer(VkDevice device, const VkBufferDeviceAddressInfo *info)
{
    return nextOfDevice<PFN_vkGetBufferDeviceAddress>(device, "vkGetBufferDeviceAddress")(device, info);
}

VKAPI_ATTR std::uint64_t VKAPI_CALL opaqueOfMemory(VkDevice, const VkDeviceMemoryOpaqueCaptureAddressInfo *info)
{
    std::lock_guard lock(mutex);
    return reinterpret_cast<std::uint64_t>(mappings[info->memory].data);
}

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice device, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    VkBufferCreateInfo plain = *info;
    plain.flags &= ~static_cast<VkBufferCreateFlags>(VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT);
    return nextOfDevice<PFN_vkCreateBuffer>(device, "vkCreateBuffer")(device, &plain, allocator, buffer);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer commands, std::uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const std::uint32_t *strides,
                                            const std::uint32_t *const *most)
{
    std::vector<std::vector<VkAccelerationStructureBuildRangeInfoKHR>> ranges(count);
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> pointers;
    for (std::uint32_t i = 0; i < count; ++i) {
        for (std::uint32_t g = 0; g < infos[i].geometryCount; ++g) {
            VkAccelerationStructureBuildRangeInfoKHR range;
            std::memcpy(&range, reinterpret_cast<const void *>(addresses[i] + std::uint64_t{g} * strides[i]),
                        sizeof range);
            if (range.primitiveCount > most[i][g])
                range.primitiveCount = most[i][g];
            ranges[i].push_back(range);
        }
        pointers.push_back(ranges[i].data());
    }
    nextOfDevice<PFN_vkCmdBuildAccelerationStructuresKHR>(commands, "vkCmdBuildAccelerationStructuresKHR")(
        commands, count, infos, pointers.data());
}

template <class Link>
Link *linkOf(const void *chain, VkStructureType type)
{
    auto *structure = static_cast<Link *>(const_cast<void *>(chain));
    while (structure != nullptr && !(structure->sType == type && structure->function == VK_LAYER_LINK_INFO))
        structure = static_cast<Link *>(const_cast<void *>(structure->pNext));
    return structure;
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance)
{
    auto *link = linkOf<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(info, allocator, instance);
    if (result == VK_SUCCESS) {
        const auto getFeatures =
            reinterpret_cast<PFN_vkGetPhysicalDeviceFeatures2>(next(*instance, "vkGetPhysicalDeviceFeatures2"));
        const auto enumerate = reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(
            next(*instance, "vkEnumerateDeviceExtensionProperties"));
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = {*instance, next, getFeatures, enumerate};
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    auto *link = linkOf<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    const PFN_vkGetDeviceProcAddr next = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    const PFN_vkGetInstanceProcAddr nextInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create =
        reinterpret_cast<PFN_vkCreateDevice>(nextInstance(tableOf(keyOf(physical)).handle, "vkCreateDevice"));
    setFeatures(info->pNext, VK_FALSE); // lavapipe must not be asked for them
    VkDeviceCreateInfo below = *info;
    std::vector<const char *> names(info->ppEnabledExtensionNames,
                                    info->ppEnabledExtensionNames + info->enabledExtensionCount);
    if (replays())
        names.push_back(kImport);
    below.enabledExtensionCount = static_cast<std::uint32_t>(names.size());
    below.ppEnabledExtensionNames = names.data();
    const VkResult result = create(physical, &below, allocator, device);
    setFeatures(info->pNext, VK_TRUE);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = {*device, next};
    }
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    const std::string wanted = name;
    if (wanted == "vkGetDeviceProcAddr")
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    if (wanted == "vkCreateBuffer")
        return reinterpret_cast<PFN_vkVoidFunction>(createBuffer);
    if (wanted == "vkAllocateMemory")
        return reinterpret_cast<PFN_vkVoidFunction>(allocateMemory);
    if (wanted == "vkFreeMemory")
        return reinterpret_cast<PFN_vkVoidFunction>(freeMemory);
    if (replays() && wanted == "vkGetBufferOpaqueCaptureAddress")
        return reinterpret_cast<PFN_vkVoidFunction>(opaqueOfBuffer);
    if (replays() && wanted == "vkGetDeviceMemoryOpaqueCaptureAddress")
        return reinterpret_cast<PFN_vkVoidFunction>(opaqueOfMemory);
    if (wanted == "vkCmdBuildAccelerationStructuresIndirectKHR")
        return reinterpret_cast<PFN_vkVoidFunction>(cmdBuildIndirect);
    return nextOfDevice<PFN_vkVoidFunction>(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    const std::string wanted = name;
    if (wanted == "vkGetInstanceProcAddr")
        return reinterpret_cast<PFN_vkVoidFunction>(getInstanceProcAddr);
    if (wanted == "vkCreateInstance")
        return reinterpret_cast<PFN_vkVoidFunction>(createInstance);
    if (wanted == "vkGetDeviceProcAddr")
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    if (wanted == "vkCreateDevice")
        return reinterpret_cast<PFN_vkVoidFunction>(createDevice);
    if (wanted == "vkGetPhysicalDeviceFeatures2" || wanted == "vkGetPhysicalDeviceFeatures2KHR")
        return reinterpret_cast<PFN_vkVoidFunction>(getFeatures2);
    if (wanted == "vkEnumerateDeviceExtensionProperties")
        return reinterpret_cast<PFN_vkVoidFunction>(enumerateExtensions);
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    return tableOf(keyOf(instance)).get(instance, name);
}

} // namespace

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = 2;
    version->pfnGetInstanceProcAddr = getInstanceProcAddr;
    version->pfnGetDeviceProcAddr = getDeviceProcAddr;
    version->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
