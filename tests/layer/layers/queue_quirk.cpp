// SPDX-License-Identifier: Apache-2.0
// The quirk "queues": one family for each purpose, where lavapipe has one queue for all of them, which executes their
// commands. Recording what a family does not support is reported, and so is a submission to a queue of another family
// than the command buffer's.
#include "layers/driver.h"

#include <cstddef>
#include <map>
#include <memory>
#include <set>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Queues;

constexpr VkQueueFlags kGraphics = VK_QUEUE_GRAPHICS_BIT, kCompute = VK_QUEUE_COMPUTE_BIT,
                       kTransfer = VK_QUEUE_TRANSFER_BIT;
// The first one cannot run compute shaders; one of them can do that and draw, as there must be (Physical Devices).
constexpr VkQueueFlags kFamilies[]{kGraphics | kTransfer, kGraphics | kCompute | kTransfer, kCompute | kTransfer,
                                   kTransfer};
constexpr auto kFamilyCount = static_cast<uint32_t>(std::size(kFamilies));

VkQueueFamilyProperties familyOf(VkPhysicalDevice handle, uint32_t family)
{
    VkQueueFamilyProperties properties{};
    uint32_t one = 1;
    DRIVER_NEXT(vkGetPhysicalDeviceQueueFamilyProperties)(handle, &one, &properties);
    properties.queueFlags = kFamilies[family];
    return properties;
}

VKAPI_ATTR void VKAPI_CALL getFamilies(VkPhysicalDevice handle, uint32_t *count, VkQueueFamilyProperties *families)
{
    if (families == nullptr) {
        *count = kFamilyCount;
        return;
    }
    *count = std::min(*count, kFamilyCount);
    for (uint32_t i = 0; i < *count; ++i)
        families[i] = familyOf(handle, i);
}

VKAPI_ATTR void VKAPI_CALL getFamilies2(VkPhysicalDevice handle, uint32_t *count, VkQueueFamilyProperties2 *families)
{
    if (families == nullptr) {
        *count = kFamilyCount;
        return;
    }
    *count = std::min(*count, kFamilyCount);
    for (uint32_t i = 0; i < *count; ++i)
        families[i].queueFamilyProperties = familyOf(handle, i);
}

// --- queues ---

// A dispatchable object: it begins with what the loader writes there.
struct Queue {
    void *loader = nullptr;
    uint32_t family = 0;
    VkQueue real = VK_NULL_HANDLE;
};

std::mutex mutex;
std::map<std::pair<VkDevice, uint32_t>, std::unique_ptr<Queue>> queues; // by family
std::map<VkCommandPool, uint32_t> poolFamilies;
std::map<VkCommandBuffer, uint32_t> commandFamilies;
std::mutex submissions; // the queues are one

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const float priority = 1;
    auto only = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    VkDeviceCreateInfo below = *info;
    below.queueCreateInfoCount = 1;
    below.pQueueCreateInfos = &only;
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, &below, allocator, device);
    if (result != VK_SUCCESS)
        return result;
    std::lock_guard lock(mutex);
    for (uint32_t i = 0; i < kFamilyCount; ++i)
        queues.erase({*device, i}); // of a device that is gone
    for (const auto &requested : std::span(info->pQueueCreateInfos, info->queueCreateInfoCount)) {
        if (requested.queueFamilyIndex >= kFamilyCount || requested.queueCount != 1)
            report("vkCreateDevice: VUID-VkDeviceCreateInfo-queueFamilyIndex-02802 or -queueCount-00382");
        else
            queues[{*device, requested.queueFamilyIndex}] =
                std::make_unique<Queue>(Queue{nullptr, requested.queueFamilyIndex});
    }
    return result;
}

// The families of a concurrent resource must be families of the device (VUID-VkBufferCreateInfo-sharingMode-00914,
// -01419).
VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    VkBufferCreateInfo below = *info;
    if (info->sharingMode == VK_SHARING_MODE_CONCURRENT) {
        const std::set<uint32_t> families(info->pQueueFamilyIndices,
                                          info->pQueueFamilyIndices + info->queueFamilyIndexCount);
        if (families.size() < 2 || families.size() != info->queueFamilyIndexCount)
            report("vkCreateBuffer: VUID-VkBufferCreateInfo-sharingMode-00914 or -01419");
        std::lock_guard lock(mutex);
        for (const uint32_t family : families) {
            if (!queues.contains({handle, family}))
                report("vkCreateBuffer: the device has no queue of family " + std::to_string(family));
        }
        below.sharingMode = VK_SHARING_MODE_EXCLUSIVE; // there is one family below
    }
    return DRIVER_NEXT(vkCreateBuffer)(handle, &below, allocator, buffer);
}

VkQueue queueOf(VkDevice handle, uint32_t family)
{
    std::lock_guard lock(mutex);
    const auto found = queues.find({handle, family});
    if (found == queues.end()) {
        report("vkGetDeviceQueue: the device has no queue of family " + std::to_string(family));
        return VK_NULL_HANDLE;
    }
    Queue &queue = *found->second;
    if (queue.real == VK_NULL_HANDLE) {
        queue.loader = keyOf(handle);
        DRIVER_NEXT(vkGetDeviceQueue)(handle, 0, 0, &queue.real);
    }
    return reinterpret_cast<VkQueue>(&queue);
}

VKAPI_ATTR void VKAPI_CALL getQueue(VkDevice handle, uint32_t family, uint32_t, VkQueue *queue)
{
    *queue = queueOf(handle, family);
}

VKAPI_ATTR void VKAPI_CALL getQueue2(VkDevice handle, const VkDeviceQueueInfo2 *info, VkQueue *queue)
{
    *queue = queueOf(handle, info->queueFamilyIndex);
}

const Queue &own(VkQueue queue)
{
    return *reinterpret_cast<const Queue *>(queue);
}

void expectFamily(const char *where, VkQueue queue, VkCommandBuffer commands)
{
    std::lock_guard lock(mutex);
    const auto family = commandFamilies.find(commands);
    if (family != commandFamilies.end() && family->second != own(queue).family)
        report(std::string(where) + ": VUID-vkQueueSubmit-pCommandBuffers-00074: a command buffer of family " +
               std::to_string(family->second) + " on a queue of family " + std::to_string(own(queue).family));
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue handle, uint32_t count, const VkSubmitInfo *infos, VkFence fence)
{
    for (const VkSubmitInfo &info : std::span(infos, count)) {
        for (VkCommandBuffer commands : std::span(info.pCommandBuffers, info.commandBufferCount))
            expectFamily("vkQueueSubmit", handle, commands);
    }
    std::lock_guard lock(submissions);
    return DRIVER_NEXT(vkQueueSubmit)(own(handle).real, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL submit2(VkQueue handle, uint32_t count, const VkSubmitInfo2 *infos, VkFence fence)
{
    for (const VkSubmitInfo2 &info : std::span(infos, count)) {
        for (const auto &commands : std::span(info.pCommandBufferInfos, info.commandBufferInfoCount))
            expectFamily("vkQueueSubmit2", handle, commands.commandBuffer);
    }
    std::lock_guard lock(submissions);
    return DRIVER_NEXT(vkQueueSubmit2)(own(handle).real, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL waitIdle(VkQueue handle)
{
    std::lock_guard lock(submissions);
    return DRIVER_NEXT(vkQueueWaitIdle)(own(handle).real);
}

VKAPI_ATTR VkResult VKAPI_CALL deviceWaitIdle(VkDevice handle)
{
    std::lock_guard lock(submissions);
    return DRIVER_NEXT(vkDeviceWaitIdle)(handle);
}

// --- command buffers ---

VKAPI_ATTR VkResult VKAPI_CALL createPool(VkDevice handle, const VkCommandPoolCreateInfo *info,
                                          const VkAllocationCallbacks *allocator, VkCommandPool *pool)
{
    VkCommandPoolCreateInfo below = *info;
    below.queueFamilyIndex = 0;
    const VkResult result = DRIVER_NEXT(vkCreateCommandPool)(handle, &below, allocator, pool);
    std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        poolFamilies[*pool] = info->queueFamilyIndex;
    if (!queues.contains({handle, info->queueFamilyIndex}))
        report("VUID-vkCreateCommandPool-queueFamilyIndex-01937");
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateCommands(VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                                VkCommandBuffer *commands)
{
    const VkResult result = DRIVER_NEXT(vkAllocateCommandBuffers)(handle, info, commands);
    std::lock_guard lock(mutex);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i)
        commandFamilies[commands[i]] = poolFamilies[info->commandPool];
    return result;
}

VkQueueFlags flagsOf(VkCommandBuffer commands)
{
    std::lock_guard lock(mutex);
    return kFamilies[commandFamilies[commands]];
}

void expectQueue(const char *command, VkCommandBuffer commands, VkQueueFlags oneOf)
{
    if ((flagsOf(commands) & oneOf) == 0)
        report(std::string(command) + ": -commandBuffer-cmdpool: not in a family with queue flags " +
               std::to_string(flagsOf(commands)));
}

void expectStages(const char *command, VkCommandBuffer commands, VkPipelineStageFlags2 stages)
{
    constexpr VkPipelineStageFlags2 kOfCompute =
        VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR |
        VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_COPY_BIT_KHR | VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR;
    constexpr VkPipelineStageFlags2 kOfGraphics =
        VK_PIPELINE_STAGE_2_VERTEX_INPUT_BIT | VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
        VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT |
        VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT |
        VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT;
    const VkQueueFlags flags = flagsOf(commands);
    if (((stages & kOfCompute) != 0 && (flags & kCompute) == 0) ||
        ((stages & kOfGraphics) != 0 && (flags & kGraphics) == 0) ||
        ((stages & VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT) != 0 && (flags & (kGraphics | kCompute)) == 0))
        report(std::string(command) + ": VUID-vkCmdPipelineBarrier-srcStageMask-06461 or its like: stages " +
               std::to_string(stages) + " in a family with queue flags " + std::to_string(flags));
}

VKAPI_ATTR void VKAPI_CALL cmdBarrier(VkCommandBuffer handle, VkPipelineStageFlags from, VkPipelineStageFlags to,
                                      VkDependencyFlags flags, uint32_t memories, const VkMemoryBarrier *memory,
                                      uint32_t buffers, const VkBufferMemoryBarrier *buffer, uint32_t images,
                                      const VkImageMemoryBarrier *image)
{
    expectStages("vkCmdPipelineBarrier", handle, from | to);
    DRIVER_NEXT(vkCmdPipelineBarrier)(handle, from, to, flags, memories, memory, buffers, buffer, images, image);
}

VKAPI_ATTR void VKAPI_CALL cmdBarrier2(VkCommandBuffer handle, const VkDependencyInfo *info)
{
    const auto expect = [&](const auto *barriers, uint32_t count) {
        for (const auto &barrier : std::span(barriers, count))
            expectStages("vkCmdPipelineBarrier2", handle, barrier.srcStageMask | barrier.dstStageMask);
    };
    expect(info->pMemoryBarriers, info->memoryBarrierCount);
    expect(info->pBufferMemoryBarriers, info->bufferMemoryBarrierCount);
    expect(info->pImageMemoryBarriers, info->imageMemoryBarrierCount);
    DRIVER_NEXT(vkCmdPipelineBarrier2)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdBindPipeline(VkCommandBuffer handle, VkPipelineBindPoint point, VkPipeline pipeline)
{
    expectQueue("vkCmdBindPipeline", handle, point == VK_PIPELINE_BIND_POINT_GRAPHICS ? kGraphics : kCompute);
    DRIVER_NEXT(vkCmdBindPipeline)(handle, point, pipeline);
}

template <size_t n>
struct Name {
    constexpr Name(const char (&text)[n]) { std::copy_n(text, n, characters); } // NOLINT
    char characters[n];
};
// The version of a command that only checks the family (its "Supported Queue Types").
template <class Function>
struct Checked;
template <class... Parameters>
struct Checked<void(VKAPI_PTR *)(VkCommandBuffer, Parameters...)> {
    template <Name name, VkQueueFlags oneOf>
    static VKAPI_ATTR void VKAPI_CALL call(VkCommandBuffer handle, Parameters... parameters)
    {
        expectQueue(name.characters, handle, oneOf);
        next<void(VKAPI_PTR *)(VkCommandBuffer, Parameters...)>(kLevel, keyOf(handle), name.characters)(handle,
                                                                                                        parameters...);
    }
};
#define CHECKED(command, oneOf)                                                                                        \
    {                                                                                                                  \
#command, DRIVER_FUNCTION((Checked <PFN_##command>::call <Name(#command), oneOf>))                             \
    }

} // namespace

driver::LevelRows driver::queueRows()
{
    constexpr VkQueueFlags kBoth = kGraphics | kCompute;
    static const Row device[]{
        {"vkGetDeviceQueue", DRIVER_FUNCTION(getQueue)},
        {"vkGetDeviceQueue2", DRIVER_FUNCTION(getQueue2)},
        {"vkQueueSubmit", DRIVER_FUNCTION(submit)},
        {"vkQueueSubmit2", DRIVER_FUNCTION(submit2)},
        {"vkQueueWaitIdle", DRIVER_FUNCTION(waitIdle)},
        {"vkDeviceWaitIdle", DRIVER_FUNCTION(deviceWaitIdle)},
        {"vkCreateBuffer", DRIVER_FUNCTION(createBuffer)},
        {"vkCreateCommandPool", DRIVER_FUNCTION(createPool)},
        {"vkAllocateCommandBuffers", DRIVER_FUNCTION(allocateCommands)},
        {"vkCmdPipelineBarrier", DRIVER_FUNCTION(cmdBarrier)},
        {"vkCmdPipelineBarrier2", DRIVER_FUNCTION(cmdBarrier2)},
        {"vkCmdBindPipeline", DRIVER_FUNCTION(cmdBindPipeline)},
        CHECKED(vkCmdDispatch, kCompute),
        CHECKED(vkCmdDispatchIndirect, kCompute),
        CHECKED(vkCmdTraceRaysKHR, kCompute),
        CHECKED(vkCmdTraceRaysIndirectKHR, kCompute),
        CHECKED(vkCmdTraceRaysIndirect2KHR, kCompute),
        CHECKED(vkCmdBuildAccelerationStructuresKHR, kCompute),
        CHECKED(vkCmdCopyAccelerationStructureKHR, kCompute),
        CHECKED(vkCmdCopyAccelerationStructureToMemoryKHR, kCompute),
        CHECKED(vkCmdCopyMemoryToAccelerationStructureKHR, kCompute),
        CHECKED(vkCmdWriteAccelerationStructuresPropertiesKHR, kCompute),
        CHECKED(vkCmdResetQueryPool, kBoth),
        CHECKED(vkCmdCopyQueryPoolResults, kBoth),
        CHECKED(vkCmdPushConstants, kBoth),
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkGetPhysicalDeviceQueueFamilyProperties", DRIVER_FUNCTION(getFamilies)},
        {"vkGetPhysicalDeviceQueueFamilyProperties2", DRIVER_FUNCTION(getFamilies2)},
    };
    return {device, instance};
}
