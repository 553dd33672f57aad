// SPDX-License-Identifier: Apache-2.0
// Drivers that hang, die, lose the device or do nothing, from a submission on: the environment variable
// VELLUM_TEST_FAULT_AFTER says after how many of the device; without it after 20.
#include "faulty_driver/faults.h"

#include <chrono>
#include <cstdlib>
#include <map>
#include <thread>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Process;

std::mutex mutex;
std::map<void *, uint64_t> submissions; // by dispatch key

uint64_t allowed()
{
    const char *value = std::getenv("VELLUM_TEST_FAULT_AFTER");
    return value != nullptr ? std::strtoull(value, nullptr, 10) : 20;
}

bool begun(void *key)
{
    std::lock_guard lock(mutex);
    return submissions[key] > allowed();
}

bool begun(void *key, const char *fault)
{
    return has(key, fault) && begun(key);
}

void hangIfChosen(void *key)
{
    while (begun(key, "hangs"))
        std::this_thread::sleep_for(std::chrono::seconds(1));
}

VkResult afterWait(void *key, VkResult result)
{
    return begun(key, "loses-device") ? VK_ERROR_DEVICE_LOST : result;
}

void count(void *key)
{
    std::lock_guard lock(mutex);
    ++submissions[key];
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        submissions[keyOf(*device)] = 0;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue handle, uint32_t infoCount, const VkSubmitInfo *infos, VkFence fence)
{
    count(keyOf(handle));
    if (begun(keyOf(handle), "loses-device"))
        return VK_ERROR_DEVICE_LOST;
    std::vector<VkSubmitInfo> all(infos, infos + infoCount);
    for (VkSubmitInfo &info : all) {
        if (begun(keyOf(handle), "does-nothing"))
            info.commandBufferCount = 0;
    }
    return DRIVER_NEXT(vkQueueSubmit)(handle, infoCount, all.data(), fence);
}

VKAPI_ATTR VkResult VKAPI_CALL submit2(VkQueue handle, uint32_t infoCount, const VkSubmitInfo2 *infos, VkFence fence)
{
    count(keyOf(handle));
    if (begun(keyOf(handle), "loses-device"))
        return VK_ERROR_DEVICE_LOST;
    std::vector<VkSubmitInfo2> all(infos, infos + infoCount);
    for (VkSubmitInfo2 &info : all) {
        if (begun(keyOf(handle), "does-nothing"))
            info.commandBufferInfoCount = 0;
    }
    return DRIVER_NEXT(vkQueueSubmit2)(handle, infoCount, all.data(), fence);
}

VKAPI_ATTR VkResult VKAPI_CALL waitQueue(VkQueue handle)
{
    hangIfChosen(keyOf(handle));
    return afterWait(keyOf(handle), DRIVER_NEXT(vkQueueWaitIdle)(handle));
}

VKAPI_ATTR VkResult VKAPI_CALL waitDevice(VkDevice handle)
{
    hangIfChosen(keyOf(handle));
    return afterWait(keyOf(handle), DRIVER_NEXT(vkDeviceWaitIdle)(handle));
}

VKAPI_ATTR VkResult VKAPI_CALL waitFences(VkDevice handle, uint32_t fenceCount, const VkFence *fences, VkBool32 all,
                                          uint64_t timeout)
{
    hangIfChosen(keyOf(handle));
    return afterWait(keyOf(handle), DRIVER_NEXT(vkWaitForFences)(handle, fenceCount, fences, all, timeout));
}

VKAPI_ATTR VkResult VKAPI_CALL waitSemaphores(VkDevice handle, const VkSemaphoreWaitInfo *info, uint64_t timeout)
{
    hangIfChosen(keyOf(handle));
    return afterWait(keyOf(handle), DRIVER_NEXT(vkWaitSemaphores)(handle, info, timeout));
}

// Queries that nothing wrote are never available.
VKAPI_ATTR VkResult VKAPI_CALL queryResults(VkDevice handle, VkQueryPool pool, uint32_t first, uint32_t queryCount,
                                            size_t size, void *data, VkDeviceSize stride, VkQueryResultFlags flags)
{
    if (begun(keyOf(handle), "does-nothing"))
        return VK_SUCCESS;
    return DRIVER_NEXT(vkGetQueryPoolResults)(handle, pool, first, queryCount, size, data, stride, flags);
}

VKAPI_ATTR VkResult VKAPI_CALL end(VkCommandBuffer handle)
{
    if (begun(keyOf(handle), "dies"))
        std::abort();
    return DRIVER_NEXT(vkEndCommandBuffer)(handle);
}

} // namespace

LevelRows processRows()
{
    static const Row device[]{
        {"vkQueueSubmit", DRIVER_FUNCTION(submit)},
        {"vkQueueSubmit2", DRIVER_FUNCTION(submit2)},
        {"vkQueueWaitIdle", DRIVER_FUNCTION(waitQueue)},
        {"vkDeviceWaitIdle", DRIVER_FUNCTION(waitDevice)},
        {"vkWaitForFences", DRIVER_FUNCTION(waitFences)},
        {"vkWaitSemaphores", DRIVER_FUNCTION(waitSemaphores)},
        {"vkGetQueryPoolResults", DRIVER_FUNCTION(queryResults)},
        {"vkEndCommandBuffer", DRIVER_FUNCTION(end)},
    };
    static const Row instance[]{{"vkCreateDevice", DRIVER_FUNCTION(createDevice)}};
    return {device, instance};
}

} // namespace faults
