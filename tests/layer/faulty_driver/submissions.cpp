// SPDX-License-Identifier: Apache-2.0
// Memory of the faulty driver, and functions that are called before and after command buffers are executed.
#include "faulty_driver/faults.h"

#include <deque>
#include <map>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Submissions;

struct Own {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
};
struct Recorded {
    void *key = nullptr;
    std::deque<std::function<void()>> before, after;
    std::vector<VkCommandBuffer> secondaries;
    std::vector<Own> memory;
};

std::mutex mutex;
std::map<VkCommandBuffer, Recorded> recorded;
std::map<VkCommandPool, std::vector<VkCommandBuffer>> pools;   // and what is allocated from them
std::map<void *, VkPhysicalDevice> physicalDevices;            // by dispatch key of the device
std::map<void *, std::deque<std::function<void()>>> onceAfter; // by dispatch key of the device

template <class Function>
Function nextOf(void *key, const char *name)
{
    return next<Function>(kLevel, key, name);
}
#define FAULTS_NEXT_OF(key, function) nextOf<PFN_##function>(key, #function)

uint32_t hostVisibleType(void *key, uint32_t allowed)
{
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    {
        std::lock_guard lock(mutex);
        physical = physicalDevices.at(key);
    }
    VkPhysicalDeviceMemoryProperties properties;
    FAULTS_NEXT_OF(keyOf(physical), vkGetPhysicalDeviceMemoryProperties)(physical, &properties);
    constexpr VkMemoryPropertyFlags kWanted =
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    uint32_t type = 0;
    while (type + 1 < properties.memoryTypeCount &&
           !((allowed >> type & 1) != 0 && (properties.memoryTypes[type].propertyFlags & kWanted) == kWanted))
        ++type;
    return type;
}

void release(Recorded &gone)
{
    if (gone.key == nullptr)
        return;
    const VkDevice device = deviceOf(gone.key);
    for (const Own &own : gone.memory) {
        FAULTS_NEXT_OF(gone.key, vkDestroyBuffer)(device, own.buffer, nullptr);
        FAULTS_NEXT_OF(gone.key, vkFreeMemory)(device, own.memory, nullptr);
    }
    gone = {};
}

void forget(VkCommandBuffer commands)
{
    Recorded gone;
    {
        std::lock_guard lock(mutex);
        if (const auto found = recorded.extract(commands); !found.empty())
            gone = std::move(found.mapped());
    }
    release(gone);
}

Recorded &recordedIn(VkCommandBuffer commands) // under the lock
{
    Recorded &entry = recorded[commands];
    entry.key = keyOf(commands);
    return entry;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        physicalDevices[keyOf(*device)] = handle;
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    if (handle == VK_NULL_HANDLE)
        return;
    std::vector<Recorded> gone;
    {
        std::lock_guard lock(mutex);
        for (auto entry = recorded.begin(); entry != recorded.end();) {
            if (entry->second.key == keyOf(handle)) {
                gone.push_back(std::move(entry->second));
                entry = recorded.erase(entry);
            } else {
                ++entry;
            }
        }
        onceAfter.erase(keyOf(handle));
    }
    for (Recorded &entry : gone)
        release(entry);
    DRIVER_NEXT(vkDestroyDevice)(handle, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL begin(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    forget(handle);
    return DRIVER_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL allocateCommandBuffers(VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                                      VkCommandBuffer *all)
{
    const VkResult result = DRIVER_NEXT(vkAllocateCommandBuffers)(handle, info, all);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        auto &known = pools[info->commandPool];
        known.insert(known.end(), all, all + info->commandBufferCount);
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyPool(VkDevice handle, VkCommandPool pool, const VkAllocationCallbacks *allocator)
{
    std::vector<VkCommandBuffer> all;
    {
        std::lock_guard lock(mutex);
        if (const auto found = pools.extract(pool); !found.empty())
            all = std::move(found.mapped());
    }
    for (const VkCommandBuffer commands : all)
        forget(commands);
    DRIVER_NEXT(vkDestroyCommandPool)(handle, pool, allocator);
}

VKAPI_ATTR void VKAPI_CALL freeCommandBuffers(VkDevice handle, VkCommandPool pool, uint32_t count,
                                              const VkCommandBuffer *all)
{
    for (const VkCommandBuffer commands : std::span(all, count)) {
        forget(commands);
        std::lock_guard lock(mutex);
        std::erase(pools[pool], commands);
    }
    DRIVER_NEXT(vkFreeCommandBuffers)(handle, pool, count, all);
}

VKAPI_ATTR void VKAPI_CALL executeCommands(VkCommandBuffer handle, uint32_t count, const VkCommandBuffer *all)
{
    {
        std::lock_guard lock(mutex);
        auto &secondaries = recordedIn(handle).secondaries;
        secondaries.insert(secondaries.end(), all, all + count);
    }
    DRIVER_NEXT(vkCmdExecuteCommands)(handle, count, all);
}

struct Functions {
    std::vector<std::function<void()>> before, after;
};

void collect(VkCommandBuffer commands, Functions &functions) // under the lock
{
    const auto found = recorded.find(commands);
    if (found == recorded.end())
        return;
    for (const VkCommandBuffer secondary : found->second.secondaries)
        collect(secondary, functions);
    functions.before.insert(functions.before.end(), found->second.before.begin(), found->second.before.end());
    functions.after.insert(functions.after.end(), found->second.after.begin(), found->second.after.end());
}

template <class Submit>
VkResult submitAround(VkQueue handle, std::span<const VkCommandBuffer> all, Submit submit)
{
    Functions functions;
    {
        std::lock_guard lock(mutex);
        for (const VkCommandBuffer commands : all)
            collect(commands, functions);
        if (!all.empty()) {
            for (auto &function : std::exchange(onceAfter[keyOf(handle)], {}))
                functions.after.push_back(std::move(function));
        }
    }
    const auto wait = DRIVER_NEXT(vkQueueWaitIdle);
    if (!functions.before.empty())
        wait(handle);
    for (const auto &function : functions.before)
        function();
    const VkResult result = submit();
    if (!functions.after.empty() && result == VK_SUCCESS)
        wait(handle);
    for (const auto &function : functions.after)
        function();
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue handle, uint32_t count, const VkSubmitInfo *infos, VkFence fence)
{
    std::vector<VkCommandBuffer> all;
    for (const VkSubmitInfo &info : std::span(infos, count))
        all.insert(all.end(), info.pCommandBuffers, info.pCommandBuffers + info.commandBufferCount);
    return submitAround(handle, all, [&] { return DRIVER_NEXT(vkQueueSubmit)(handle, count, infos, fence); });
}

VKAPI_ATTR VkResult VKAPI_CALL submit2(VkQueue handle, uint32_t count, const VkSubmitInfo2 *infos, VkFence fence)
{
    std::vector<VkCommandBuffer> all;
    for (const VkSubmitInfo2 &info : std::span(infos, count)) {
        for (uint32_t i = 0; i < info.commandBufferInfoCount; ++i)
            all.push_back(info.pCommandBufferInfos[i].commandBuffer);
    }
    return submitAround(handle, all, [&] { return DRIVER_NEXT(vkQueueSubmit2)(handle, count, infos, fence); });
}

} // namespace

Memory memoryFor(VkCommandBuffer handle, VkDeviceSize bytes)
{
    const VkDevice device = deviceOf(keyOf(handle));
    constexpr VkDeviceSize kAlignment = 256;
    const auto info = vkInit<VkBufferCreateInfo>(
        {.size = bytes + kAlignment,
         .usage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                  VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                  VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR});
    Own own;
    DRIVER_NEXT(vkCreateBuffer)(device, &info, nullptr, &own.buffer);
    VkMemoryRequirements needs;
    DRIVER_NEXT(vkGetBufferMemoryRequirements)(device, own.buffer, &needs);
    auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    const auto allocation =
        vkInit<VkMemoryAllocateInfo>({.pNext = &flags,
                                      .allocationSize = needs.size,
                                      .memoryTypeIndex = hostVisibleType(keyOf(handle), needs.memoryTypeBits)});
    DRIVER_NEXT(vkAllocateMemory)(device, &allocation, nullptr, &own.memory);
    DRIVER_NEXT(vkBindBufferMemory)(device, own.buffer, own.memory, 0);
    const auto query = vkInit<VkBufferDeviceAddressInfo>({.buffer = own.buffer});
    const VkDeviceAddress address = DRIVER_NEXT(vkGetBufferDeviceAddress)(device, &query);
    {
        std::lock_guard lock(mutex);
        recordedIn(handle).memory.push_back(own);
    }
    const VkDeviceAddress aligned = (address + kAlignment - 1) / kAlignment * kAlignment;
    return {hostPointer<uint8_t>(aligned), aligned};
}

void beforeExecution(VkCommandBuffer commands, std::function<void()> function)
{
    std::lock_guard lock(mutex);
    recordedIn(commands).before.push_back(std::move(function));
}

void afterExecution(VkCommandBuffer commands, std::function<void()> function)
{
    std::lock_guard lock(mutex);
    recordedIn(commands).after.push_back(std::move(function));
}

void afterNextSubmission(void *key, std::function<void()> function)
{
    std::lock_guard lock(mutex);
    onceAfter[key].push_back(std::move(function));
}

LevelRows submissionRows()
{
    static const Row device[]{
        {"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
        {"vkBeginCommandBuffer", DRIVER_FUNCTION(begin)},
        {"vkAllocateCommandBuffers", DRIVER_FUNCTION(allocateCommandBuffers)},
        {"vkFreeCommandBuffers", DRIVER_FUNCTION(freeCommandBuffers)},
        {"vkDestroyCommandPool", DRIVER_FUNCTION(destroyPool)},
        {"vkCmdExecuteCommands", DRIVER_FUNCTION(executeCommands)},
        {"vkQueueSubmit", DRIVER_FUNCTION(submit)},
        {"vkQueueSubmit2", DRIVER_FUNCTION(submit2)},
    };
    static const Row instance[]{{"vkCreateDevice", DRIVER_FUNCTION(createDevice)}};
    return {device, instance};
}

} // namespace faults
