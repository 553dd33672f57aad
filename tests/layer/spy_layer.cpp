// A layer for the tests, below Vellum's: it stands for a driver that knows nothing of micromaps, and tells the debug
// messengers of every flag, structure and extension name of theirs that reaches it. (The validation layer does not: it
// knows the extension and lets most of its bits pass.)
// It also checks that stack sizes which the application sets have room for all shaders of the driver's pipeline, and,
// where VELLUM_TEST_SPY_DEFER is in the environment, is a driver that defers the creation of ray tracing pipelines.
// Where VELLUM_TEST_SPY_MARKER is there, it is a driver with VK_AMD_buffer_marker; where VELLUM_TEST_SPY_BARRIERS is,
// it tells of every memory and buffer barrier.
// Where VELLUM_TEST_SPY_DISPLACEMENT is there when the instance is made, the driver says that it has micromaps, and
// displacement micromaps. Where VELLUM_TEST_SPY_MEMORY is there when the instance is made, the driver has one more type
// of memory; for as long as it stays there, the others have none left.
#include <vulkan/vk_layer.h>

#include "vellum/vulkan_opacity_micromap.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace
{

struct Messenger {
    VkDebugUtilsMessengerEXT handle;
    PFN_vkDebugUtilsMessengerCallbackEXT callback;
    void *user;
};

std::mutex mutex;
// By dispatch key; entries stay, a later handle with the same key replaces them.
// Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
struct InstanceTable {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr getProcAddr = nullptr;
    PFN_vkCreateDebugUtilsMessengerEXT createMessenger = nullptr;
    PFN_vkDestroyDebugUtilsMessengerEXT destroyMessenger = nullptr;
    PFN_vkGetPhysicalDeviceMemoryProperties getMemoryProperties = nullptr;
    PFN_vkEnumerateDeviceExtensionProperties enumerateExtensions = nullptr;
    PFN_vkGetPhysicalDeviceFeatures2 getFeatures = nullptr;
    PFN_vkGetPhysicalDeviceProperties2 getProperties = nullptr;
};
std::map<void *, InstanceTable> instances;
std::map<void *, PFN_vkGetDeviceProcAddr> devices;
std::map<void *, VkDevice> deviceHandles;
std::vector<Messenger> messengers;

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

template <class Function>
Function nextOfDevice(void *key, const char *name)
{
    std::lock_guard lock(mutex);
    return reinterpret_cast<Function>(devices.at(key)(deviceHandles.at(key), name));
}

void tell(const std::string &text)
{
    std::vector<Messenger> all;
    {
        std::lock_guard lock(mutex);
        all = messengers;
    }
    VkDebugUtilsMessengerCallbackDataEXT data{};
    data.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CALLBACK_DATA_EXT;
    data.pMessageIdName = "SPY";
    data.pMessage = text.c_str();
    for (const Messenger &m : all)
        m.callback(VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT, &data,
                   m.user);
}

void expectStages(const char *where, VkPipelineStageFlags2 stages)
{
    if ((stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) != 0)
        tell(std::string(where) + ": MICROMAP_BUILD stage");
}

void expectAccess(const char *where, VkAccessFlags2 access)
{
    if ((access & (VK_ACCESS_2_MICROMAP_READ_BIT_EXT | VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT)) != 0)
        tell(std::string(where) + ": MICROMAP_READ or MICROMAP_WRITE access");
}

template <class Barrier>
void expectBarrier(const char *where, const Barrier &barrier)
{
    expectStages(where, barrier.srcStageMask);
    expectStages(where, barrier.dstStageMask);
    expectAccess(where, barrier.srcAccessMask);
    expectAccess(where, barrier.dstAccessMask);
}

const void *inChain(const void *chain, VkStructureType type)
{
    const auto *structure = static_cast<const VkBaseInStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    return structure;
}

// "MEMORY srcStage srcAccess dstStage dstAccess", and for buffers " srcFamily dstFamily offset size buffer" after it.
template <class Barrier>
void tellBarrier(const Barrier &b)
{
    if (std::getenv("VELLUM_TEST_SPY_BARRIERS") == nullptr)
        return;
    std::ostringstream text;
    text << std::hex << "MEMORY " << b.srcStageMask << ' ' << b.srcAccessMask << ' ' << b.dstStageMask << ' '
         << b.dstAccessMask;
    if constexpr (std::is_same_v<Barrier, VkBufferMemoryBarrier2>)
        text << ' ' << b.srcQueueFamilyIndex << ' ' << b.dstQueueFamilyIndex << ' ' << b.offset << ' ' << b.size << ' '
             << reinterpret_cast<std::uint64_t>(b.buffer);
    tell(text.str());
}

void expectDependency(const char *where, const VkDependencyInfo &info)
{
    if (inChain(info.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR) != nullptr)
        tell(std::string(where) + ": VkMemoryRangeBarriersInfoKHR");
    for (const VkMemoryBarrier2 &b : std::span(info.pMemoryBarriers, info.memoryBarrierCount))
        tellBarrier(b);
    for (const VkBufferMemoryBarrier2 &b : std::span(info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount))
        tellBarrier(b);
    for (const VkMemoryBarrier2 &b : std::span(info.pMemoryBarriers, info.memoryBarrierCount))
        expectBarrier(where, b);
    for (const VkBufferMemoryBarrier2 &b : std::span(info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount))
        expectBarrier(where, b);
    for (const VkImageMemoryBarrier2 &b : std::span(info.pImageMemoryBarriers, info.imageMemoryBarrierCount))
        expectBarrier(where, b);
}

void expectBuild(const char *where, const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    constexpr VkFlags ours = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
                             VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT |
                             VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT |
                             0x400; // VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR
    if (info.type > VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        tell(std::string(where) + ": a type that the driver does not know");
    if ((info.flags & ours) != 0)
        tell(std::string(where) + ": micromap build flags");
    for (std::uint32_t i = 0; i < info.geometryCount; ++i) {
        const VkAccelerationStructureGeometryKHR &geometry =
            info.pGeometries != nullptr ? info.pGeometries[i] : *info.ppGeometries[i];
        if (geometry.geometryType > VK_GEOMETRY_TYPE_INSTANCES_KHR)
            tell(std::string(where) + ": a type of geometry that the driver does not know");
        // VkAccelerationStructureTrianglesOpacityMicromapKHR
        if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR &&
            inChain(geometry.geometry.triangles.pNext, static_cast<VkStructureType>(1000623003)) != nullptr)
            tell(std::string(where) + ": VkAccelerationStructureTrianglesOpacityMicromapKHR");
        if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR &&
            inChain(geometry.geometry.triangles.pNext,
                    VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT) != nullptr)
            tell(std::string(where) + ": VkAccelerationStructureTrianglesOpacityMicromapEXT");
    }
}

#define SPY_NEXT(function) nextOfDevice<PFN_##function>(keyOf(handle), #function)

// Acceleration structures that are the driver's: others, which the layer has by itself, must not come here.
std::set<VkAccelerationStructureKHR> structures;
std::mutex structuresMutex;

// Whether it is the driver's; the spy tells of the others.
bool expectStructure(const char *where, VkAccelerationStructureKHR structure)
{
    bool known = structure == VK_NULL_HANDLE;
    {
        std::lock_guard lock(structuresMutex);
        known = known || structures.contains(structure);
    }
    if (!known)
        tell(std::string(where) + ": an acceleration structure that is not the driver's");
    return known;
}

bool expectObject(const char *where, VkObjectType type, std::uint64_t object)
{
    if (type == VK_OBJECT_TYPE_MICROMAP_EXT)
        tell(std::string(where) + ": an object of type VK_OBJECT_TYPE_MICROMAP_EXT");
    if (type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR)
        return expectStructure(where, reinterpret_cast<VkAccelerationStructureKHR>(object));
    return type != VK_OBJECT_TYPE_MICROMAP_EXT;
}

VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *allocator,
                                               VkAccelerationStructureKHR *structure)
{
    if (info->type > VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        tell("vkCreateAccelerationStructureKHR: a type that the driver does not know");
    const VkResult result = SPY_NEXT(vkCreateAccelerationStructureKHR)(handle, info, allocator, structure);
    std::lock_guard lock(structuresMutex);
    if (result == VK_SUCCESS)
        structures.insert(*structure);
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *allocator)
{
    expectStructure("vkDestroyAccelerationStructureKHR", structure);
    {
        std::lock_guard lock(structuresMutex);
        structures.erase(structure);
    }
    SPY_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

VKAPI_ATTR void VKAPI_CALL copyStructure(VkCommandBuffer handle, const VkCopyAccelerationStructureInfoKHR *info)
{
    expectStructure("vkCmdCopyAccelerationStructureKHR", info->src);
    expectStructure("vkCmdCopyAccelerationStructureKHR", info->dst);
    SPY_NEXT(vkCmdCopyAccelerationStructureKHR)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL writeProperties(VkCommandBuffer handle, std::uint32_t count,
                                           const VkAccelerationStructureKHR *list, VkQueryType type, VkQueryPool pool,
                                           std::uint32_t first)
{
    for (const VkAccelerationStructureKHR structure : std::span(list, count))
        expectStructure("vkCmdWriteAccelerationStructuresPropertiesKHR", structure);
    SPY_NEXT(vkCmdWriteAccelerationStructuresPropertiesKHR)(handle, count, list, type, pool, first);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL structureAddress(VkDevice handle,
                                                       const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    expectStructure("vkGetAccelerationStructureDeviceAddressKHR", info->accelerationStructure);
    return SPY_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL setPrivateData(VkDevice handle, VkObjectType type, std::uint64_t object,
                                              VkPrivateDataSlot slot, std::uint64_t data)
{
    return expectObject("vkSetPrivateData", type, object) ? SPY_NEXT(vkSetPrivateData)(handle, type, object, slot, data)
                                                          : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL getPrivateData(VkDevice handle, VkObjectType type, std::uint64_t object,
                                          VkPrivateDataSlot slot, std::uint64_t *data)
{
    if (expectObject("vkGetPrivateData", type, object))
        SPY_NEXT(vkGetPrivateData)(handle, type, object, slot, data);
}

VKAPI_ATTR VkResult VKAPI_CALL setName(VkDevice handle, const VkDebugUtilsObjectNameInfoEXT *info)
{
    const auto next = SPY_NEXT(vkSetDebugUtilsObjectNameEXT);
    return expectObject("vkSetDebugUtilsObjectNameEXT", info->objectType, info->objectHandle) && next != nullptr
               ? next(handle, info)
               : VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL setTag(VkDevice handle, const VkDebugUtilsObjectTagInfoEXT *info)
{
    const auto next = SPY_NEXT(vkSetDebugUtilsObjectTagEXT);
    return expectObject("vkSetDebugUtilsObjectTagEXT", info->objectType, info->objectHandle) && next != nullptr
               ? next(handle, info)
               : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier2(VkCommandBuffer handle, const VkDependencyInfo *info)
{
    expectDependency("vkCmdPipelineBarrier2", *info);
    SPY_NEXT(vkCmdPipelineBarrier2)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdSetEvent2(VkCommandBuffer handle, VkEvent event, const VkDependencyInfo *info)
{
    expectDependency("vkCmdSetEvent2", *info);
    SPY_NEXT(vkCmdSetEvent2)(handle, event, info);
}

VKAPI_ATTR void VKAPI_CALL cmdResetEvent2(VkCommandBuffer handle, VkEvent event, VkPipelineStageFlags2 stages)
{
    expectStages("vkCmdResetEvent2", stages);
    SPY_NEXT(vkCmdResetEvent2)(handle, event, stages);
}

VKAPI_ATTR void VKAPI_CALL cmdWaitEvents2(VkCommandBuffer handle, std::uint32_t count, const VkEvent *events,
                                          const VkDependencyInfo *infos)
{
    for (std::uint32_t i = 0; i < count; ++i)
        expectDependency("vkCmdWaitEvents2", infos[i]);
    SPY_NEXT(vkCmdWaitEvents2)(handle, count, events, infos);
}

VKAPI_ATTR void VKAPI_CALL cmdWriteTimestamp2(VkCommandBuffer handle, VkPipelineStageFlags2 stage, VkQueryPool pool,
                                              std::uint32_t query)
{
    expectStages("vkCmdWriteTimestamp2", stage);
    SPY_NEXT(vkCmdWriteTimestamp2)(handle, stage, pool, query);
}

// Whether the driver has it or not: lavapipe has not.
VKAPI_ATTR void VKAPI_CALL cmdWriteBufferMarker2(VkCommandBuffer handle, VkPipelineStageFlags2 stage, VkBuffer buffer,
                                                 VkDeviceSize offset, std::uint32_t marker)
{
    expectStages("vkCmdWriteBufferMarker2AMD", stage);
    if (std::getenv("VELLUM_TEST_SPY_MARKER") != nullptr)
        SPY_NEXT(vkCmdFillBuffer)(handle, buffer, offset, 4, marker);
}

VKAPI_ATTR VkResult VKAPI_CALL queueSubmit2(VkQueue handle, std::uint32_t count, const VkSubmitInfo2 *submits,
                                            VkFence fence)
{
    for (const VkSubmitInfo2 &s : std::span(submits, count)) {
        for (const VkSemaphoreSubmitInfo &w : std::span(s.pWaitSemaphoreInfos, s.waitSemaphoreInfoCount))
            expectStages("vkQueueSubmit2", w.stageMask);
        for (const VkSemaphoreSubmitInfo &w : std::span(s.pSignalSemaphoreInfos, s.signalSemaphoreInfoCount))
            expectStages("vkQueueSubmit2", w.stageMask);
    }
    return SPY_NEXT(vkQueueSubmit2)(handle, count, submits, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL createRenderPass2(VkDevice handle, const VkRenderPassCreateInfo2 *info,
                                                 const VkAllocationCallbacks *allocator, VkRenderPass *pass)
{
    for (const VkSubpassDependency2 &d : std::span(info->pDependencies, info->dependencyCount)) {
        if (const void *barrier = inChain(d.pNext, VK_STRUCTURE_TYPE_MEMORY_BARRIER_2))
            expectBarrier("vkCreateRenderPass2", *static_cast<const VkMemoryBarrier2 *>(barrier));
    }
    return SPY_NEXT(vkCreateRenderPass2)(handle, info, allocator, pass);
}

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    struct Usage2 { // VkBufferUsageFlags2CreateInfo, which older headers lack
        VkStructureType sType;
        const void *pNext;
        VkFlags64 usage;
    };
    const auto *flags2 = static_cast<const Usage2 *>(inChain(info->pNext, static_cast<VkStructureType>(1000470006)));
    if (((info->usage | (flags2 != nullptr ? flags2->usage : 0)) &
         (VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT)) != 0)
        tell("vkCreateBuffer: micromap usage");
    return SPY_NEXT(vkCreateBuffer)(handle, info, allocator, buffer);
}

// --- a memory type more: that of the host, where lavapipe's are local to the device ---

bool moreMemory = false;
std::uint32_t memoryTypesBelow = 0;

VKAPI_ATTR void VKAPI_CALL getMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties *memory)
{
    tableOf(keyOf(handle)).getMemoryProperties(handle, memory);
    if (!moreMemory)
        return;
    memoryTypesBelow = memory->memoryTypeCount;
    memory->memoryTypes[memory->memoryTypeCount++] = {
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT, 0};
}

VKAPI_ATTR void VKAPI_CALL getBufferRequirements(VkDevice handle, VkBuffer buffer, VkMemoryRequirements *requirements)
{
    SPY_NEXT(vkGetBufferMemoryRequirements)(handle, buffer, requirements);
    if (moreMemory)
        requirements->memoryTypeBits |= 1u << memoryTypesBelow;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    VkMemoryAllocateInfo below = *info;
    if (moreMemory && info->memoryTypeIndex == memoryTypesBelow)
        below.memoryTypeIndex = 0;
    else if (std::getenv("VELLUM_TEST_SPY_MEMORY") != nullptr)
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    return SPY_NEXT(vkAllocateMemory)(handle, &below, allocator, memory);
}

// --- VK_NV_displacement_micromap ---

constexpr const char *kDisplacement = "VK_NV_displacement_micromap";
bool displacement = false;

struct OneMember { // VkPhysicalDeviceDisplacementMicromapFeaturesNV and ...PropertiesNV
    VkStructureType sType;
    void *pNext;
    std::uint32_t value;
};

void answer(void *chain, VkStructureType type, std::uint32_t value)
{
    auto *structure = static_cast<VkBaseOutStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    if (displacement && structure != nullptr)
        reinterpret_cast<OneMember *>(structure)->value = value;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, std::uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    const auto next = tableOf(keyOf(handle)).enumerateExtensions;
    if (!displacement || layer != nullptr)
        return next(handle, layer, count, properties);
    std::uint32_t below = 0;
    next(handle, nullptr, &below, nullptr);
    std::vector<VkExtensionProperties> all(below);
    next(handle, nullptr, &below, all.data());
    for (const char *name : {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, kDisplacement}) {
        std::strcpy(all.emplace_back().extensionName, name);
        all.back().specVersion = 1;
    }
    const auto size = static_cast<std::uint32_t>(all.size());
    if (properties == nullptr) {
        *count = size;
        return VK_SUCCESS;
    }
    *count = std::min(*count, size);
    std::copy_n(all.begin(), *count, properties);
    return *count < size ? VK_INCOMPLETE : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    tableOf(keyOf(handle)).getFeatures(handle, features);
    answer(features->pNext, static_cast<VkStructureType>(1000397000), VK_TRUE);
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    tableOf(keyOf(handle)).getProperties(handle, properties);
    answer(properties->pNext, static_cast<VkStructureType>(1000397001), 5);
}

// Whether the driver has VK_EXT_debug_marker or not: lavapipe has not.
VKAPI_ATTR VkResult VKAPI_CALL setMarkerName(VkDevice, const VkDebugMarkerObjectNameInfoEXT *info)
{
    expectObject("vkDebugMarkerSetObjectNameEXT", static_cast<VkObjectType>(info->objectType), info->object);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL setMarkerTag(VkDevice, const VkDebugMarkerObjectTagInfoEXT *info)
{
    expectObject("vkDebugMarkerSetObjectTagEXT", static_cast<VkObjectType>(info->objectType), info->object);
    return VK_SUCCESS;
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
        tell(std::string(where) + (was ? ": memory that is mapped" : ": memory that is not mapped"));
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
    SPY_NEXT(vkFreeMemory)(handle, memory, allocator);
}

VKAPI_ATTR void VKAPI_CALL getBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                         const std::uint32_t *counts, VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    expectBuild("vkGetAccelerationStructureBuildSizesKHR", *info);
    SPY_NEXT(vkGetAccelerationStructureBuildSizesKHR)(handle, type, info, counts, sizes);
}

// Whoever waits for a build, waits for the stage of builds only: what the layer adds to a build by a transfer must be
// ordered before what comes in that stage. And whoever makes a build wait, for a semaphore, makes it wait in that
// stage: the transfer must wait for what comes before it in that stage.
struct Updates {
    bool built = false;   // there was a build in the command buffer
    bool pending = false; // and then a transfer, and no barrier since
    bool waits = false;   // there was a barrier from that stage to transfers
};
std::map<VkCommandBuffer, Updates> updates;

VKAPI_ATTR VkResult VKAPI_CALL beginCommandBuffer(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        std::lock_guard lock(mutex);
        updates.erase(handle);
    }
    return SPY_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdUpdateBuffer(VkCommandBuffer handle, VkBuffer buffer, VkDeviceSize offset,
                                           VkDeviceSize size, const void *data)
{
    bool waits = false;
    {
        std::lock_guard lock(mutex);
        updates[handle].pending = updates[handle].built;
        waits = updates[handle].waits;
    }
    constexpr VkDeviceSize cell = 32; // what the layer writes; the tests write other sizes
    if (size == cell && !waits)
        tell("vkCmdUpdateBuffer: not ordered after builds before it");
    SPY_NEXT(vkCmdUpdateBuffer)(handle, buffer, offset, size, data);
}

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier(VkCommandBuffer handle, VkPipelineStageFlags from,
                                              VkPipelineStageFlags to, VkDependencyFlags flags, std::uint32_t count,
                                              const VkMemoryBarrier *memory, std::uint32_t buffers,
                                              const VkBufferMemoryBarrier *buffer, std::uint32_t images,
                                              const VkImageMemoryBarrier *image)
{
    constexpr VkPipelineStageFlags transfer = VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    constexpr VkPipelineStageFlags builds =
        VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR | VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    {
        std::lock_guard lock(mutex);
        if ((from & transfer) != 0 && (to & builds) != 0)
            updates[handle].pending = false;
        if ((from & builds) != 0 && (to & transfer) != 0)
            updates[handle].waits = true;
    }
    SPY_NEXT(vkCmdPipelineBarrier)(handle, from, to, flags, count, memory, buffers, buffer, images, image);
}

VKAPI_ATTR VkResult VKAPI_CALL endCommandBuffer(VkCommandBuffer handle)
{
    bool pending = false;
    {
        std::lock_guard lock(mutex);
        pending = updates[handle].pending;
    }
    if (pending)
        tell("vkEndCommandBuffer: a transfer after a build, and no barrier");
    return SPY_NEXT(vkEndCommandBuffer)(handle);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, std::uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    for (std::uint32_t i = 0; i < count; ++i)
        expectBuild("vkCmdBuildAccelerationStructuresKHR", infos[i]);
    {
        std::lock_guard lock(mutex);
        updates[handle].built = true;
        updates[handle].pending = false;
    }
    SPY_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

// Flags of a pipeline, from wherever it has them.
VkFlags64 pipelineFlags(const void *pNext, VkPipelineCreateFlags flags)
{
    constexpr auto flags2Type = static_cast<VkStructureType>(1000470005);
    struct Flags2 { // VkPipelineCreateFlags2CreateInfo
        VkStructureType sType;
        const void *pNext;
        VkFlags64 flags;
    };
    const auto *flags2 = static_cast<const Flags2 *>(inChain(pNext, flags2Type));
    return flags2 != nullptr ? flags2->flags : VkFlags64{flags};
}
constexpr VkFlags64 kDisallowMicromaps = VkFlags64{1} << 37; // ..._DISALLOW_OPACITY_MICROMAP_BIT_ARM
constexpr VkFlags64 kDisallowMixed = VkFlags64{1} << 41;     // ..._DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR

// What no kind of pipeline may have.
void expectPromises(const char *where, VkFlags64 flags)
{
    if ((flags & kDisallowMicromaps) != 0)
        tell(std::string(where) + ": DISALLOW_OPACITY_MICROMAP_BIT_ARM");
    if ((flags & kDisallowMixed) != 0)
        tell(std::string(where) + ": OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR");
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, std::uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (const VkComputePipelineCreateInfo &info : std::span(infos, count))
        expectPromises("vkCreateComputePipelines", pipelineFlags(info.pNext, info.flags));
    return SPY_NEXT(vkCreateComputePipelines)(handle, cache, count, infos, allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphicsPipelines(VkDevice handle, VkPipelineCache cache, std::uint32_t count,
                                                       const VkGraphicsPipelineCreateInfo *infos,
                                                       const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (const VkGraphicsPipelineCreateInfo &info : std::span(infos, count))
        expectPromises("vkCreateGraphicsPipelines", pipelineFlags(info.pNext, info.flags));
    return SPY_NEXT(vkCreateGraphicsPipelines)(handle, cache, count, infos, allocator, pipelines);
}

struct ShaderCreateInfo { // VkShaderCreateInfoEXT, which older headers lack
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkShaderStageFlagBits stage;
    VkShaderStageFlags nextStage;
    std::uint32_t codeType;
    std::size_t codeSize;
    const void *pCode;
    const char *pName;
    std::uint32_t setLayoutCount;
    const VkDescriptorSetLayout *pSetLayouts;
    std::uint32_t pushConstantRangeCount;
    const VkPushConstantRange *pPushConstantRanges;
    const VkSpecializationInfo *pSpecializationInfo;
};

VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice handle, std::uint32_t count, const ShaderCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, void *shaders)
{
    constexpr VkFlags disallowMixed = 1u << 12; // ..._OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT
    for (const ShaderCreateInfo &info : std::span(infos, count)) {
        if ((info.flags & disallowMixed) != 0)
            tell("vkCreateShadersEXT: OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT");
    }
    const auto next = nextOfDevice<decltype(&createShaders)>(keyOf(handle), "vkCreateShadersEXT");
    return next(handle, count, infos, allocator, shaders);
}

// --- ray tracing pipelines ---

// What the specification's formula for the default stack size needs (raytracing.adoc, "Ray Tracing Pipeline Stack").
struct StackNeed {
    VkDeviceSize raygen = 0, miss = 0, closestHit = 0, anyHit = 0, intersection = 0, callable = 0;
    std::uint32_t depth = 0;

    void add(const StackNeed &other)
    {
        raygen = std::max(raygen, other.raygen);
        miss = std::max(miss, other.miss);
        closestHit = std::max(closestHit, other.closestHit);
        anyHit = std::max(anyHit, other.anyHit);
        intersection = std::max(intersection, other.intersection);
        callable = std::max(callable, other.callable);
    }
    [[nodiscard]] VkDeviceSize total() const
    {
        const VkDeviceSize hitOrMiss = std::max(closestHit, miss);
        return raygen + std::min(1u, depth) * std::max(hitOrMiss, intersection + anyHit) +
               (depth > 0 ? depth - 1 : 0) * hitOrMiss + 2 * callable;
    }
};
std::map<VkPipeline, StackNeed> stackNeeds;
std::map<VkCommandBuffer, VkPipeline> boundPipelines; // ray tracing

// Creations that were put off: what the caller gave, and is bound to keep alive until the operation completes.
struct Deferral {
    VkDevice device;
    VkPipelineCache cache;
    std::uint32_t count;
    const VkRayTracingPipelineCreateInfoKHR *infos;
    const VkAllocationCallbacks *allocator;
    VkPipeline *pipelines;
    VkResult result = VK_NOT_READY;
    bool joined = false;
};
std::map<VkDeferredOperationKHR, Deferral> deferrals;

StackNeed stackNeed(VkDevice handle, const VkRayTracingPipelineCreateInfoKHR &info, VkPipeline pipeline)
{
    const auto sizeOf = SPY_NEXT(vkGetRayTracingShaderGroupStackSizeKHR);
    StackNeed need;
    need.depth = info.maxPipelineRayRecursionDepth;
    for (std::uint32_t i = 0; i < info.groupCount; ++i) {
        const VkRayTracingShaderGroupCreateInfoKHR &group = info.pGroups[i];
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
            const VkDeviceSize size = sizeOf(handle, pipeline, i, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
            const VkShaderStageFlagBits stage = info.pStages[group.generalShader].stage;
            VkDeviceSize &part = stage == VK_SHADER_STAGE_RAYGEN_BIT_KHR ? need.raygen
                                 : stage == VK_SHADER_STAGE_MISS_BIT_KHR ? need.miss
                                                                         : need.callable;
            part = std::max(part, size);
            continue;
        }
        const auto add = [&](std::uint32_t shader, VkShaderGroupShaderKHR which, VkDeviceSize &part) {
            if (shader != VK_SHADER_UNUSED_KHR)
                part = std::max(part, sizeOf(handle, pipeline, i, which));
        };
        add(group.closestHitShader, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR, need.closestHit);
        add(group.anyHitShader, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR, need.anyHit);
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR)
            add(group.intersectionShader, VK_SHADER_GROUP_SHADER_INTERSECTION_KHR, need.intersection);
    }
    std::lock_guard lock(mutex);
    for (std::uint32_t i = 0; info.pLibraryInfo != nullptr && i < info.pLibraryInfo->libraryCount; ++i)
        need.add(stackNeeds[info.pLibraryInfo->pLibraries[i]]);
    return need;
}

void expectPipeline(const VkRayTracingPipelineCreateInfoKHR &info)
{
    const VkFlags64 flags = pipelineFlags(info.pNext, info.flags);
    if ((flags & VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT) != 0)
        tell("vkCreateRayTracingPipelinesKHR: VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT");
    expectPromises("vkCreateRayTracingPipelinesKHR", flags);
}

VkResult createPipelinesNow(VkDevice handle, VkDeferredOperationKHR operation, const Deferral &call)
{
    const VkResult result = SPY_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, call.cache, call.count,
                                                                     call.infos, call.allocator, call.pipelines);
    if (result != VK_SUCCESS && result != VK_OPERATION_NOT_DEFERRED_KHR)
        return result;
    for (std::uint32_t i = 0; i < call.count; ++i) {
        const StackNeed need = stackNeed(handle, call.infos[i], call.pipelines[i]);
        std::lock_guard lock(mutex);
        stackNeeds[call.pipelines[i]] = need;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, std::uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (std::uint32_t i = 0; i < count; ++i)
        expectPipeline(infos[i]);
    const Deferral call{handle, cache, count, infos, allocator, pipelines};
    if (operation == VK_NULL_HANDLE || std::getenv("VELLUM_TEST_SPY_DEFER") == nullptr)
        return createPipelinesNow(handle, operation, call);
    std::lock_guard lock(mutex);
    deferrals[operation] = call;
    return VK_OPERATION_DEFERRED_KHR;
}

VKAPI_ATTR VkResult VKAPI_CALL deferredOperationJoin(VkDevice handle, VkDeferredOperationKHR operation)
{
    Deferral call{};
    {
        std::lock_guard lock(mutex);
        const auto found = deferrals.find(operation);
        if (found != deferrals.end()) {
            call = found->second;
            found->second.joined = true;
        }
    }
    if (call.device == VK_NULL_HANDLE)
        return SPY_NEXT(vkDeferredOperationJoinKHR)(handle, operation);
    if (call.joined) // one thread is all that the work is good for
        return call.result == VK_NOT_READY ? VK_THREAD_DONE_KHR : VK_SUCCESS;
    const VkResult result = createPipelinesNow(handle, VK_NULL_HANDLE, call);
    std::lock_guard lock(mutex);
    deferrals[operation].result = result;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL getDeferredOperationResult(VkDevice handle, VkDeferredOperationKHR operation)
{
    {
        std::lock_guard lock(mutex);
        const auto found = deferrals.find(operation);
        if (found != deferrals.end())
            return found->second.result;
    }
    return SPY_NEXT(vkGetDeferredOperationResultKHR)(handle, operation);
}

VKAPI_ATTR void VKAPI_CALL destroyDeferredOperation(VkDevice handle, VkDeferredOperationKHR operation,
                                                    const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        deferrals.erase(operation);
    }
    SPY_NEXT(vkDestroyDeferredOperationKHR)(handle, operation, allocator);
}

VKAPI_ATTR void VKAPI_CALL cmdBindPipeline(VkCommandBuffer handle, VkPipelineBindPoint point, VkPipeline pipeline)
{
    if (point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) {
        std::lock_guard lock(mutex);
        boundPipelines[handle] = pipeline;
    }
    SPY_NEXT(vkCmdBindPipeline)(handle, point, pipeline);
}

// The tests set it after they have bound the pipeline that it is for.
VKAPI_ATTR void VKAPI_CALL cmdSetStackSize(VkCommandBuffer handle, std::uint32_t size)
{
    VkDeviceSize need = 0;
    {
        std::lock_guard lock(mutex);
        need = stackNeeds[boundPipelines[handle]].total();
    }
    if (size < need)
        tell("vkCmdSetRayTracingPipelineStackSizeKHR: " + std::to_string(size) + " bytes where the pipeline needs " +
             std::to_string(need));
    SPY_NEXT(vkCmdSetRayTracingPipelineStackSizeKHR)(handle, size);
}

PFN_vkVoidFunction deviceFunction(const char *name)
{
    struct Row {
        const char *name;
        PFN_vkVoidFunction function;
    };
    const auto is = [name](const char *other) {
        // With or without the KHR of the extension it came from.
        const std::size_t length = std::strlen(other);
        return std::strncmp(name, other, length) == 0 && (name[length] == 0 || std::strcmp(name + length, "KHR") == 0);
    };
    const Row rows[]{
        {"vkBeginCommandBuffer", reinterpret_cast<PFN_vkVoidFunction>(beginCommandBuffer)},
        {"vkEndCommandBuffer", reinterpret_cast<PFN_vkVoidFunction>(endCommandBuffer)},
        {"vkCmdUpdateBuffer", reinterpret_cast<PFN_vkVoidFunction>(cmdUpdateBuffer)},
        {"vkCmdPipelineBarrier", reinterpret_cast<PFN_vkVoidFunction>(cmdPipelineBarrier)},
        {"vkCmdPipelineBarrier2", reinterpret_cast<PFN_vkVoidFunction>(cmdPipelineBarrier2)},
        {"vkCmdSetEvent2", reinterpret_cast<PFN_vkVoidFunction>(cmdSetEvent2)},
        {"vkCmdResetEvent2", reinterpret_cast<PFN_vkVoidFunction>(cmdResetEvent2)},
        {"vkCmdWaitEvents2", reinterpret_cast<PFN_vkVoidFunction>(cmdWaitEvents2)},
        {"vkCmdWriteTimestamp2", reinterpret_cast<PFN_vkVoidFunction>(cmdWriteTimestamp2)},
        {"vkQueueSubmit2", reinterpret_cast<PFN_vkVoidFunction>(queueSubmit2)},
        {"vkCreateRenderPass2", reinterpret_cast<PFN_vkVoidFunction>(createRenderPass2)},
        {"vkCreateComputePipelines", reinterpret_cast<PFN_vkVoidFunction>(createComputePipelines)},
        {"vkGetBufferMemoryRequirements", reinterpret_cast<PFN_vkVoidFunction>(getBufferRequirements)},
        {"vkAllocateMemory", reinterpret_cast<PFN_vkVoidFunction>(allocateMemory)},
        {"vkMapMemory", reinterpret_cast<PFN_vkVoidFunction>(mapMemory)},
        {"vkMapMemory2", reinterpret_cast<PFN_vkVoidFunction>(mapMemory2)},
        {"vkUnmapMemory", reinterpret_cast<PFN_vkVoidFunction>(unmapMemory)},
        {"vkFreeMemory", reinterpret_cast<PFN_vkVoidFunction>(freeMemory)},
        {"vkCreateGraphicsPipelines", reinterpret_cast<PFN_vkVoidFunction>(createGraphicsPipelines)},
        {"vkCreateShadersEXT", reinterpret_cast<PFN_vkVoidFunction>(createShaders)},
        {"vkCreateAccelerationStructureKHR", reinterpret_cast<PFN_vkVoidFunction>(createStructure)},
        {"vkDestroyAccelerationStructureKHR", reinterpret_cast<PFN_vkVoidFunction>(destroyStructure)},
        {"vkCmdCopyAccelerationStructureKHR", reinterpret_cast<PFN_vkVoidFunction>(copyStructure)},
        {"vkCmdWriteAccelerationStructuresPropertiesKHR", reinterpret_cast<PFN_vkVoidFunction>(writeProperties)},
        {"vkGetAccelerationStructureDeviceAddressKHR", reinterpret_cast<PFN_vkVoidFunction>(structureAddress)},
        {"vkSetPrivateData", reinterpret_cast<PFN_vkVoidFunction>(setPrivateData)},
        {"vkGetPrivateData", reinterpret_cast<PFN_vkVoidFunction>(getPrivateData)},
        {"vkSetDebugUtilsObjectNameEXT", reinterpret_cast<PFN_vkVoidFunction>(setName)},
        {"vkSetDebugUtilsObjectTagEXT", reinterpret_cast<PFN_vkVoidFunction>(setTag)},
        {"vkCreateBuffer", reinterpret_cast<PFN_vkVoidFunction>(createBuffer)},
        {"vkGetAccelerationStructureBuildSizesKHR", reinterpret_cast<PFN_vkVoidFunction>(getBuildSizes)},
        {"vkCmdBuildAccelerationStructuresKHR", reinterpret_cast<PFN_vkVoidFunction>(cmdBuild)},
        {"vkCreateRayTracingPipelinesKHR", reinterpret_cast<PFN_vkVoidFunction>(createRayTracingPipelines)},
        {"vkDeferredOperationJoinKHR", reinterpret_cast<PFN_vkVoidFunction>(deferredOperationJoin)},
        {"vkGetDeferredOperationResultKHR", reinterpret_cast<PFN_vkVoidFunction>(getDeferredOperationResult)},
        {"vkDestroyDeferredOperationKHR", reinterpret_cast<PFN_vkVoidFunction>(destroyDeferredOperation)},
        {"vkCmdBindPipeline", reinterpret_cast<PFN_vkVoidFunction>(cmdBindPipeline)},
        {"vkCmdSetRayTracingPipelineStackSizeKHR", reinterpret_cast<PFN_vkVoidFunction>(cmdSetStackSize)},
    };
    for (const Row &row : rows) {
        if (is(row.name))
            return row.function;
    }
    return nullptr;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    if (std::strcmp(name, "vkCmdWriteBufferMarker2AMD") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(cmdWriteBufferMarker2);
    if (std::strcmp(name, "vkDebugMarkerSetObjectNameEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(setMarkerName);
    if (std::strcmp(name, "vkDebugMarkerSetObjectTagEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(setMarkerTag);
    PFN_vkGetDeviceProcAddr next = nullptr;
    {
        std::lock_guard lock(mutex);
        next = devices.at(keyOf(device));
    }
    // By which the layer knows that the extension is there.
    if (std::strcmp(name, "vkCmdWriteBufferMarkerAMD") == 0 && std::getenv("VELLUM_TEST_SPY_MARKER") != nullptr)
        return reinterpret_cast<PFN_vkVoidFunction>(cmdWriteBufferMarker2);
    const PFN_vkVoidFunction below = next(device, name);
    const PFN_vkVoidFunction ours = below != nullptr ? deviceFunction(name) : nullptr;
    return ours != nullptr ? ours : below;
}

// The loader's link to the layer below, which is moved on for that layer's own use.
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
    displacement = std::getenv("VELLUM_TEST_SPY_DISPLACEMENT") != nullptr;
    moreMemory = std::getenv("VELLUM_TEST_SPY_MEMORY") != nullptr;
    auto *link = linkOf<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(info, allocator, instance);
    if (result == VK_SUCCESS) {
        InstanceTable table{*instance, next};
        table.createMessenger =
            reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(next(*instance, "vkCreateDebugUtilsMessengerEXT"));
        table.destroyMessenger =
            reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(next(*instance, "vkDestroyDebugUtilsMessengerEXT"));
        table.enumerateExtensions = reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(
            next(*instance, "vkEnumerateDeviceExtensionProperties"));
        table.getFeatures =
            reinterpret_cast<PFN_vkGetPhysicalDeviceFeatures2>(next(*instance, "vkGetPhysicalDeviceFeatures2"));
        table.getProperties =
            reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(next(*instance, "vkGetPhysicalDeviceProperties2"));
        table.getMemoryProperties = reinterpret_cast<PFN_vkGetPhysicalDeviceMemoryProperties>(
            next(*instance, "vkGetPhysicalDeviceMemoryProperties"));
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = table;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    for (const char *name : std::span(info->ppEnabledExtensionNames, info->enabledExtensionCount)) {
        if (std::strcmp(name, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0)
            tell("vkCreateDevice: VK_EXT_opacity_micromap");
        if (std::strcmp(name, "VK_KHR_opacity_micromap") == 0)
            tell("vkCreateDevice: VK_KHR_opacity_micromap");
        if (std::strcmp(name, "VK_ARM_pipeline_opacity_micromap") == 0)
            tell("vkCreateDevice: VK_ARM_pipeline_opacity_micromap");
        if (std::strcmp(name, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) == 0)
            tell("vkCreateDevice: VK_KHR_device_address_commands");
        if (std::strcmp(name, kDisplacement) == 0)
            tell("vkCreateDevice: VK_NV_displacement_micromap");
    }
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesEXT");
    if (inChain(info->pNext, static_cast<VkStructureType>(1000623000)) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesKHR");
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR");
    // VkPhysicalDevicePipelineOpacityMicromapFeaturesARM
    if (inChain(info->pNext, static_cast<VkStructureType>(1000596000)) != nullptr)
        tell("vkCreateDevice: features of pipelines with micromaps");
    auto *link = linkOf<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr nextInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    const PFN_vkGetDeviceProcAddr next = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkInstance instance = tableOf(keyOf(physical)).handle;
    const auto create = reinterpret_cast<PFN_vkCreateDevice>(nextInstance(instance, "vkCreateDevice"));
    const VkResult result = create(physical, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = next;
        deviceHandles[keyOf(*device)] = *device;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createMessenger(VkInstance instance, const VkDebugUtilsMessengerCreateInfoEXT *info,
                                               const VkAllocationCallbacks *allocator, VkDebugUtilsMessengerEXT *out)
{
    const VkResult result = tableOf(keyOf(instance)).createMessenger(instance, info, allocator, out);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        messengers.push_back({*out, info->pfnUserCallback, info->pUserData});
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger,
                                            const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        std::erase_if(messengers, [messenger](const Messenger &m) { return m.handle == messenger; });
    }
    tableOf(keyOf(instance)).destroyMessenger(instance, messenger, allocator);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    if (std::strcmp(name, "vkGetInstanceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getInstanceProcAddr);
    if (std::strcmp(name, "vkCreateInstance") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createInstance);
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    if (std::strcmp(name, "vkCreateDevice") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createDevice);
    if (std::strcmp(name, "vkEnumerateDeviceExtensionProperties") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(enumerateExtensions);
    if (std::strcmp(name, "vkGetPhysicalDeviceFeatures2") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getFeatures);
    if (std::strcmp(name, "vkGetPhysicalDeviceProperties2") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getProperties);
    if (std::strcmp(name, "vkGetPhysicalDeviceMemoryProperties") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getMemoryProperties);
    if (std::strcmp(name, "vkCreateDebugUtilsMessengerEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createMessenger);
    if (std::strcmp(name, "vkDestroyDebugUtilsMessengerEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(destroyMessenger);
    if (const PFN_vkVoidFunction ours = deviceFunction(name))
        return ours;
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    return tableOf(keyOf(instance)).getProcAddr(instance, name);
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
