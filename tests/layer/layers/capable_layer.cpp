// A layer for the tests, below Vellum's: it makes a driver with features that lavapipe lacks out of lavapipe, whose
// device addresses are the host's.
//   - accelerationStructureIndirectBuild: the ranges are read when the build is recorded, and built directly.
//   - bufferDeviceAddressCaptureReplay: buffers and memory take the flags, and are where they happen to be.
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <cstring>
#include <map>
#include <mutex>
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
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = {*instance, next, getFeatures};
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
    const VkResult result = create(physical, info, allocator, device);
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
