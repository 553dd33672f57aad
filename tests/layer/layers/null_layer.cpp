// A layer for the tests, directly above a driver without a device: Mesa's RADV with RADV_FORCE_FAMILY compiles shaders
// for a GPU that is not there, but has no memory and no fences, and must not be given commands. This layer answers for
// all of these. Memory is the host's, and so are addresses; commands do nothing, and submissions are done at once. What
// is left to the driver is what it can do: everything about shader modules, layouts and pipelines.
// One thing is computed: the answer to the question whether ray flag bits come back (pipelines/ray_flag_probe.h), which
// is yes, as it is on RADV's hardware.
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <sys/mman.h>

#include <atomic>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

namespace
{

std::mutex mutex;
// Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
struct InstanceTable {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr get = nullptr;
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
const T *inChain(const void *chain, VkStructureType type)
{
    const auto *structure = static_cast<const VkBaseInStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    return reinterpret_cast<const T *>(structure);
}

// Objects of this layer's own are nothing but numbers.
template <class Handle>
void makeHandle(Handle *handle)
{
    static std::atomic<std::uint64_t> last{0x1000};
    *handle = reinterpret_cast<Handle>(last += 16);
}

// --- memory ---

constexpr VkDeviceSize kHeapBytes = VkDeviceSize{4} << 30;

struct Memory {
    std::byte *data = nullptr;
    std::size_t mapped = 0; // bytes that are this layer's, not imported
};
struct Place {
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
};
std::map<VkDeviceMemory, Memory> memories;
std::map<VkBuffer, Place> buffers;
std::map<VkAccelerationStructureKHR, std::pair<VkBuffer, VkDeviceSize>> structures;

VkDeviceAddress addressOf(VkBuffer buffer) // the mutex is taken
{
    const auto found = buffers.find(buffer);
    if (found == buffers.end())
        return 0;
    return reinterpret_cast<VkDeviceAddress>(memories[found->second.memory].data) + found->second.offset;
}

VKAPI_ATTR void VKAPI_CALL memoryProperties(VkPhysicalDevice, VkPhysicalDeviceMemoryProperties *properties)
{
    *properties = {};
    properties->memoryTypeCount = 1;
    properties->memoryTypes[0] = {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                      VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT,
                                  0};
    properties->memoryHeapCount = 1;
    properties->memoryHeaps[0] = {kHeapBytes, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
}

VKAPI_ATTR void VKAPI_CALL memoryProperties2(VkPhysicalDevice physical, VkPhysicalDeviceMemoryProperties2 *properties)
{
    memoryProperties(physical, &properties->memoryProperties);
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice, const VkMemoryAllocateInfo *info, const VkAllocationCallbacks *,
                                              VkDeviceMemory *memory)
{
    Memory made;
    const auto *import =
        inChain<VkImportMemoryHostPointerInfoEXT>(info->pNext, VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT);
    if (import != nullptr) {
        made.data = static_cast<std::byte *>(import->pHostPointer);
    } else {
        void *data = mmap(nullptr, info->allocationSize, PROT_READ | PROT_WRITE,
                          MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (data == MAP_FAILED)
            return VK_ERROR_OUT_OF_DEVICE_MEMORY;
        made = {static_cast<std::byte *>(data), info->allocationSize};
    }
    makeHandle(memory);
    std::lock_guard lock(mutex);
    memories[*memory] = made;
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks *)
{
    std::lock_guard lock(mutex);
    const auto found = memories.extract(memory);
    if (found && found.mapped().mapped != 0)
        munmap(found.mapped().data, found.mapped().mapped);
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize,
                                         VkMemoryMapFlags, void **data)
{
    std::lock_guard lock(mutex);
    *data = memories[memory].data + offset;
    return VK_SUCCESS;
}

struct MapInfo { // VkMemoryMapInfo, for headers that lack it
    VkStructureType sType;
    const void *pNext;
    VkMemoryMapFlags flags;
    VkDeviceMemory memory;
    VkDeviceSize offset;
    VkDeviceSize size;
};

VKAPI_ATTR VkResult VKAPI_CALL mapMemory2(VkDevice device, const MapInfo *info, void **data)
{
    return mapMemory(device, info->memory, info->offset, info->size, info->flags, data);
}

VKAPI_ATTR VkResult VKAPI_CALL hostPointerProperties(VkDevice, VkExternalMemoryHandleTypeFlagBits, const void *,
                                                     VkMemoryHostPointerPropertiesEXT *properties)
{
    properties->memoryTypeBits = 1;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL bindBuffers(VkDevice, std::uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    std::lock_guard lock(mutex);
    for (std::uint32_t i = 0; i < count; ++i)
        buffers[infos[i].buffer] = {infos[i].memory, infos[i].memoryOffset};
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL bindBuffer(VkDevice device, VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset)
{
    const VkBindBufferMemoryInfo info{VK_STRUCTURE_TYPE_BIND_BUFFER_MEMORY_INFO, nullptr, buffer, memory, offset};
    return bindBuffers(device, 1, &info);
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice device, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        buffers.erase(buffer);
    }
    nextOfDevice<PFN_vkDestroyBuffer>(device, "vkDestroyBuffer")(device, buffer, allocator);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL bufferAddress(VkDevice, const VkBufferDeviceAddressInfo *info)
{
    std::lock_guard lock(mutex);
    return addressOf(info->buffer);
}

VKAPI_ATTR std::uint64_t VKAPI_CALL opaqueOfMemory(VkDevice, const VkDeviceMemoryOpaqueCaptureAddressInfo *info)
{
    std::lock_guard lock(mutex);
    return reinterpret_cast<std::uint64_t>(memories[info->memory].data);
}

VKAPI_ATTR void VKAPI_CALL bufferRequirements(VkDevice device, VkBuffer buffer, VkMemoryRequirements *requirements)
{
    nextOfDevice<PFN_vkGetBufferMemoryRequirements>(device, "vkGetBufferMemoryRequirements")(device, buffer,
                                                                                             requirements);
    requirements->memoryTypeBits = 1;
}

template <const char *const &name, class Info>
VKAPI_ATTR void VKAPI_CALL requirements2(VkDevice device, const Info *info, VkMemoryRequirements2 *requirements)
{
    using Function = void(VKAPI_PTR *)(VkDevice, const Info *, VkMemoryRequirements2 *);
    nextOfDevice<Function>(device, name)(device, info, requirements);
    requirements->memoryRequirements.memoryTypeBits = 1;
}
constexpr const char *kBufferRequirements = "vkGetBufferMemoryRequirements2";
constexpr const char *kDeviceRequirements = "vkGetDeviceBufferMemoryRequirements";

VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *, VkAccelerationStructureKHR *structure)
{
    makeHandle(structure);
    std::lock_guard lock(mutex);
    structures[*structure] = {info->buffer, info->offset};
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *)
{
    std::lock_guard lock(mutex);
    structures.erase(structure);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL structureAddress(VkDevice,
                                                       const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    std::lock_guard lock(mutex);
    const auto &[buffer, offset] = structures[info->accelerationStructure];
    return addressOf(buffer) + offset;
}

// --- work ---

VKAPI_ATTR void VKAPI_CALL nothing() {}

VKAPI_ATTR VkResult VKAPI_CALL success()
{
    return VK_SUCCESS;
}

template <class Info, class Handle>
VKAPI_ATTR VkResult VKAPI_CALL create(VkDevice, const Info *, const VkAllocationCallbacks *, Handle *handle)
{
    makeHandle(handle);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL semaphoreValue(VkDevice, VkSemaphore, std::uint64_t *value)
{
    *value = UINT64_MAX;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL queryResults(VkDevice, VkQueryPool, std::uint32_t, std::uint32_t, std::size_t size,
                                            void *data, VkDeviceSize, VkQueryResultFlags)
{
    std::memset(data, 0, size);
    return VK_SUCCESS;
}

// --- the question about ray flag bits ---

struct Question { // RayFlagProbePush
    std::uint64_t scene, result;
    std::uint32_t rayFlags;
};
constexpr std::uint32_t kAskedBits = 0x3800;
std::map<VkCommandBuffer, Question> questions;

VKAPI_ATTR void VKAPI_CALL pushConstants(VkCommandBuffer commands, VkPipelineLayout, VkShaderStageFlags,
                                         std::uint32_t offset, std::uint32_t size, const void *values)
{
    Question question{};
    if (offset != 0 || size < offsetof(Question, rayFlags) + sizeof question.rayFlags)
        return;
    std::memcpy(&question, values, offsetof(Question, rayFlags) + sizeof question.rayFlags);
    std::lock_guard lock(mutex);
    questions.erase(commands);
    if (question.rayFlags == kAskedBits)
        questions[commands] = question;
}

void answer(VkCommandBuffer commands, std::uint32_t first, std::uint32_t second)
{
    std::lock_guard lock(mutex);
    const auto found = questions.extract(commands);
    if (!found)
        return;
    auto *result = reinterpret_cast<std::uint32_t *>(found.mapped().result);
    result[0] = first;
    result[1] = second;
}

VKAPI_ATTR void VKAPI_CALL dispatch(VkCommandBuffer commands, std::uint32_t x, std::uint32_t y, std::uint32_t z)
{
    constexpr std::uint32_t kCommittedTriangle = 1;
    if (x * y * z == 1)
        answer(commands, kAskedBits, kCommittedTriangle);
}

VKAPI_ATTR void VKAPI_CALL traceRays(VkCommandBuffer commands, const VkStridedDeviceAddressRegionKHR *,
                                     const VkStridedDeviceAddressRegionKHR *, const VkStridedDeviceAddressRegionKHR *,
                                     const VkStridedDeviceAddressRegionKHR *, std::uint32_t, std::uint32_t,
                                     std::uint32_t)
{
    answer(commands, kAskedBits, kAskedBits);
}

// --- tables ---

struct Row {
    std::string_view name; // without the KHR or EXT of the extension it came from, where core has it
    PFN_vkVoidFunction function;
};
#define ROW(name, function)                                                                                            \
    Row                                                                                                                \
    {                                                                                                                  \
        name, reinterpret_cast<PFN_vkVoidFunction>(function)                                                           \
    }

PFN_vkVoidFunction deviceFunction(std::string_view name)
{
    static const Row rows[] = {
        ROW("vkAllocateMemory", allocateMemory),
        ROW("vkFreeMemory", freeMemory),
        ROW("vkMapMemory", mapMemory),
        ROW("vkMapMemory2", mapMemory2),
        ROW("vkUnmapMemory", nothing),
        ROW("vkUnmapMemory2", success),
        ROW("vkFlushMappedMemoryRanges", success),
        ROW("vkInvalidateMappedMemoryRanges", success),
        ROW("vkGetMemoryHostPointerPropertiesEXT", hostPointerProperties),
        ROW("vkBindBufferMemory", bindBuffer),
        ROW("vkBindBufferMemory2", bindBuffers),
        ROW("vkBindImageMemory", success),
        ROW("vkBindImageMemory2", success),
        ROW("vkDestroyBuffer", destroyBuffer),
        ROW("vkGetBufferDeviceAddress", bufferAddress),
        ROW("vkGetBufferOpaqueCaptureAddress", bufferAddress),
        ROW("vkGetDeviceMemoryOpaqueCaptureAddress", opaqueOfMemory),
        ROW("vkGetBufferMemoryRequirements", bufferRequirements),
        ROW("vkGetBufferMemoryRequirements2", (requirements2<kBufferRequirements, VkBufferMemoryRequirementsInfo2>)),
        ROW("vkGetDeviceBufferMemoryRequirements",
            (requirements2<kDeviceRequirements, VkDeviceBufferMemoryRequirements>)),
        ROW("vkCreateAccelerationStructureKHR", createStructure),
        ROW("vkDestroyAccelerationStructureKHR", destroyStructure),
        ROW("vkGetAccelerationStructureDeviceAddressKHR", structureAddress),
        ROW("vkCreateFence", (create<VkFenceCreateInfo, VkFence>)),
        ROW("vkDestroyFence", nothing),
        ROW("vkResetFences", success),
        ROW("vkGetFenceStatus", success),
        ROW("vkWaitForFences", success),
        ROW("vkCreateSemaphore", (create<VkSemaphoreCreateInfo, VkSemaphore>)),
        ROW("vkDestroySemaphore", nothing),
        ROW("vkSignalSemaphore", success),
        ROW("vkWaitSemaphores", success),
        ROW("vkGetSemaphoreCounterValue", semaphoreValue),
        ROW("vkCreateQueryPool", (create<VkQueryPoolCreateInfo, VkQueryPool>)),
        ROW("vkDestroyQueryPool", nothing),
        ROW("vkResetQueryPool", nothing),
        ROW("vkGetQueryPoolResults", queryResults),
        ROW("vkQueueSubmit", success),
        ROW("vkQueueSubmit2", success),
        ROW("vkQueueBindSparse", success),
        ROW("vkQueueWaitIdle", success),
        ROW("vkDeviceWaitIdle", success),
        ROW("vkBeginCommandBuffer", success),
        ROW("vkEndCommandBuffer", success),
        ROW("vkResetCommandBuffer", success),
        ROW("vkResetCommandPool", success),
        ROW("vkCmdPushConstants", pushConstants),
        ROW("vkCmdDispatch", dispatch),
        ROW("vkCmdTraceRaysKHR", traceRays),
    };
    for (const std::string_view suffix : {"", "KHR", "EXT"}) {
        if (!name.ends_with(suffix))
            continue;
        for (const Row &row : rows) {
            if (row.name == name.substr(0, name.size() - suffix.size()))
                return row.function;
        }
    }
    return name.starts_with("vkCmd") ? reinterpret_cast<PFN_vkVoidFunction>(nothing) : nullptr;
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
    const auto createNext = reinterpret_cast<PFN_vkCreateInstance>(next(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = createNext(info, allocator, instance);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = {*instance, next};
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
    const auto createNext =
        reinterpret_cast<PFN_vkCreateDevice>(nextInstance(tableOf(keyOf(physical)).handle, "vkCreateDevice"));
    const VkResult result = createNext(physical, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = {*device, next};
    }
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::string_view(name) == "vkGetDeviceProcAddr")
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    const auto below = nextOfDevice<PFN_vkVoidFunction>(device, name);
    const PFN_vkVoidFunction ours = below != nullptr ? deviceFunction(name) : nullptr;
    return ours != nullptr ? ours : below;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    static const Row rows[] = {
        ROW("vkGetInstanceProcAddr", getInstanceProcAddr),
        ROW("vkGetDeviceProcAddr", getDeviceProcAddr),
        ROW("vkCreateInstance", createInstance),
        ROW("vkCreateDevice", createDevice),
        ROW("vkGetPhysicalDeviceMemoryProperties", memoryProperties),
        ROW("vkGetPhysicalDeviceMemoryProperties2", memoryProperties2),
        ROW("vkGetPhysicalDeviceMemoryProperties2KHR", memoryProperties2),
    };
    for (const Row &row : rows) {
        if (row.name == name)
            return row.function;
    }
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    const PFN_vkVoidFunction ours = deviceFunction(name);
    return ours != nullptr ? ours : tableOf(keyOf(instance)).get(instance, name);
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
