// SPDX-License-Identifier: Apache-2.0
// The quirks of a failing driver.
//   - "failures": the n-th command, counted from now, of those that may run out of memory fails, or every
//     submission from now on, as of a lost device (Lost Device). Tests choose by functions of this library.
//   - "uncompiled": a pipeline with VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT is not made.
// A command that fails leaves no object behind. The quirk counts the objects that exist, and reports destruction after
// the process has begun to end, when a driver may be unloaded.
#include "layers/driver.h"

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include "vk/newer.h"

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Failures;

std::atomic<uint64_t> calls = 0, failsAt = 0;
std::atomic<bool> counting = false, lost = false;
std::atomic<const char *> failed = "nothing";

// True if this call is to fail.
bool fails(const char *command)
{
    if (!counting || ++calls != failsAt)
        return false;
    failed = command;
    return true;
}

template <size_t n>
struct Name {
    constexpr Name(const char (&text)[n]) { std::copy_n(text, n, characters); } // NOLINT
    char characters[n];
};

std::atomic<long> objects = 0;
std::atomic<bool> ended = false;
struct Ending {
    ~Ending() { ended = true; }
} ending;

VkResult counted(VkResult result)
{
    objects += result == VK_SUCCESS ? 1 : 0;
    return result;
}

// A command of a device that destroys an object.
template <class Function>
struct Destroying;
template <class Handle>
struct Destroying<void(VKAPI_PTR *)(VkDevice, Handle, const VkAllocationCallbacks *)> {
    template <Name name>
    static VKAPI_ATTR void VKAPI_CALL call(VkDevice handle, Handle object, const VkAllocationCallbacks *allocator)
    {
        if (ended) {
            std::fprintf(stderr, "mock driver: %s in an exit handler\n", name.characters);
            std::abort();
        }
        objects -= object != Handle{} ? 1 : 0;
        next<void(VKAPI_PTR *)(VkDevice, Handle, const VkAllocationCallbacks *)>(
            kLevel, keyOf(handle), name.characters)(handle, object, allocator);
    }
};
#define DESTROYING(command)                                                                                            \
    {                                                                                                                  \
#command, DRIVER_FUNCTION((Destroying <PFN_##command>::call <Name(#command)>))                                 \
    }
// A command of a device that may run out of memory.
template <class Function>
struct Fallible;
template <class Object, class... Parameters>
struct Fallible<VkResult(VKAPI_PTR *)(Object, Parameters...)> {
    template <Name name, VkResult error>
    static VKAPI_ATTR VkResult VKAPI_CALL call(Object handle, Parameters... parameters)
    {
        return fails(name.characters) ? error
                                      : next<VkResult(VKAPI_PTR *)(Object, Parameters...)>(
                                            kLevel, keyOf(handle), name.characters)(handle, parameters...);
    }
    template <Name name, VkResult error>
    static VKAPI_ATTR VkResult VKAPI_CALL create(Object handle, Parameters... parameters)
    {
        return counted(call<name, error>(handle, parameters...));
    }
};
#define FALLIBLE(command)                                                                                              \
    {                                                                                                                  \
#command, DRIVER_FUNCTION((Fallible <PFN_##command>::call <Name(#command), VK_ERROR_OUT_OF_DEVICE_MEMORY>))    \
    }

#define CREATING(command)                                                                                              \
    {                                                                                                                  \
#command, DRIVER_FUNCTION((Fallible <PFN_##command>::create <Name(#command), VK_ERROR_OUT_OF_DEVICE_MEMORY>))  \
    }

// A command after which the device may be lost.
template <class Function>
struct Losing;
template <class Object, class... Parameters>
struct Losing<VkResult(VKAPI_PTR *)(Object, Parameters...)> {
    template <Name name>
    static VKAPI_ATTR VkResult VKAPI_CALL call(Object handle, Parameters... parameters)
    {
        const auto command = next<VkResult(VKAPI_PTR *)(Object, Parameters...)>(kLevel, keyOf(handle), name.characters);
        return lost                     ? VK_ERROR_DEVICE_LOST
               : fails(name.characters) ? VK_ERROR_OUT_OF_DEVICE_MEMORY
                                        : command(handle, parameters...);
    }
};
#define LOSING(command)                                                                                                \
    {                                                                                                                  \
#command, DRIVER_FUNCTION((Losing <PFN_##command>::call <Name(#command)>))                                     \
    }

// All bindings are attempted, and VkBindMemoryStatus holds the result of each (VK_KHR_maintenance6).
VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice handle, uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    VkResult any = VK_SUCCESS;
    for (const VkBindBufferMemoryInfo &info : std::span(infos, count)) {
        const VkResult result = fails("vkBindBufferMemory2") ? VK_ERROR_OUT_OF_DEVICE_MEMORY
                                                             : DRIVER_NEXT(vkBindBufferMemory2)(handle, 1, &info);
        if (const auto *status = inChain<VkBindMemoryStatusKHR>(info.pNext, VK_STRUCTURE_TYPE_BIND_MEMORY_STATUS_KHR))
            *status->pResult = result;
        if (result != VK_SUCCESS)
            any = result;
    }
    return any;
}

// --- devices ---

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    return counted(DRIVER_NEXT(vkCreateDevice)(handle, info, allocator, device));
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    const auto destroy = DRIVER_NEXT(vkDestroyDevice);
    --objects;
    destroy(handle, allocator);
}

// --- pipelines and shaders, of which a command makes several ---

template <class Handle>
void countMade(const Handle *handles, uint32_t count)
{
    objects += static_cast<long>(count - std::count(handles, handles + count, Handle{}));
}

VKAPI_ATTR VkResult VKAPI_CALL createPipelineBinaries(VkDevice handle, const VkPipelineBinaryCreateInfoKHR *info,
                                                      const VkAllocationCallbacks *allocator,
                                                      VkPipelineBinaryHandlesInfoKHR *binaries)
{
    const VkResult result = next<PFN_vkCreatePipelineBinariesKHR>(kLevel, keyOf(handle), "vkCreatePipelineBinariesKHR")(
        handle, info, allocator, binaries);
    if (binaries->pPipelineBinaries != nullptr)
        countMade(binaries->pPipelineBinaries, binaries->pipelineBinaryCount);
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice handle, uint32_t count, const VkShaderCreateInfoEXT *infos,
                                             const VkAllocationCallbacks *allocator, VkShaderEXT *shaders)
{
    const VkResult result = next<PFN_vkCreateShadersEXT>(kLevel, keyOf(handle), "vkCreateShadersEXT")(
        handle, count, infos, allocator, shaders);
    if (result == VK_SUCCESS)
        countMade(shaders, count);
    return result;
}

constexpr VkPipelineCreateFlags kNoCompiling = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
constexpr VkPipelineCreateFlags kEarlyReturn = VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT;

VkFlags64 flagsOf(const void *chain, VkPipelineCreateFlags flags)
{
    const auto *flags2 =
        inChain<VkPipelineCreateFlags2CreateInfoKHR>(chain, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    return flags2 != nullptr ? flags2->flags : VkFlags64{flags};
}

// One after the other ("Multiple Pipeline Creation"); the handle of a pipeline that fails is null.
template <class Info, class Create>
VkResult createEach(const char *command, void *key, uint32_t count, const Info *infos, VkPipeline *pipelines,
                    Create create)
{
    VkResult worst = VK_SUCCESS;
    std::fill_n(pipelines, count, VK_NULL_HANDLE);
    for (uint32_t i = 0; i < count; ++i) {
        const VkFlags64 flags = flagsOf(infos[i].pNext, infos[i].flags);
        VkResult result = VK_SUCCESS;
        if (fails(command))
            result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
        else if (has(key, "uncompiled") && (flags & kNoCompiling) != 0)
            result = VK_PIPELINE_COMPILE_REQUIRED;
        else
            result = create(infos[i], &pipelines[i]);
        countMade(&pipelines[i], 1);
        if (result < 0 || worst == VK_SUCCESS)
            worst = result;
        if (result != VK_SUCCESS && (flags & kEarlyReturn) != 0)
            break;
    }
    return worst;
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    constexpr const char *kCommand = "vkCreateComputePipelines";
    return createEach(kCommand, keyOf(handle), count, infos, pipelines, [&](const auto &info, VkPipeline *pipeline) {
        return DRIVER_NEXT(vkCreateComputePipelines)(handle, cache, 1, &info, allocator, pipeline);
    });
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    if (operation != VK_NULL_HANDLE && count > 1) {
        const VkResult result =
            DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, count, infos, allocator, pipelines);
        countMade(pipelines, count);
        return result;
    }
    constexpr const char *kCommand = "vkCreateRayTracingPipelinesKHR";
    return createEach(kCommand, keyOf(handle), count, infos, pipelines, [&](const auto &info, VkPipeline *pipeline) {
        return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, 1, &info, allocator, pipeline);
    });
}

} // namespace

driver::LevelRows driver::failureRows()
{
    static const Row device[]{
        CREATING(vkCreateBuffer),
        CREATING(vkAllocateMemory),
        FALLIBLE(vkBindBufferMemory),
        FALLIBLE(vkMapMemory),
        CREATING(vkCreateShaderModule),
        CREATING(vkCreatePipelineLayout),
        CREATING(vkCreateAccelerationStructureKHR),
        FALLIBLE(vkGetRayTracingShaderGroupHandlesKHR),
        CREATING(vkCreateQueryPool),
        CREATING(vkCreateCommandPool),
        FALLIBLE(vkAllocateCommandBuffers),
        FALLIBLE(vkBeginCommandBuffer),
        FALLIBLE(vkEndCommandBuffer),
        CREATING(vkCreateFence),
        LOSING(vkQueueSubmit),
        LOSING(vkQueueSubmit2),
        LOSING(vkQueueWaitIdle),
        LOSING(vkDeviceWaitIdle),
        LOSING(vkWaitForFences),
        LOSING(vkGetFenceStatus),
        LOSING(vkGetQueryPoolResults),
        {"vkBindBufferMemory2", DRIVER_FUNCTION(bindBufferMemory2)},
        {"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
        DESTROYING(vkDestroyBuffer),
        DESTROYING(vkFreeMemory),
        DESTROYING(vkDestroyShaderModule),
        DESTROYING(vkDestroyPipelineLayout),
        DESTROYING(vkDestroyPipeline),
        DESTROYING(vkDestroyAccelerationStructureKHR),
        DESTROYING(vkDestroyQueryPool),
        DESTROYING(vkDestroyCommandPool),
        DESTROYING(vkDestroyFence),
        {"vkDestroyPipelineBinaryKHR",
         DRIVER_FUNCTION((Destroying<PFN_vkDestroyPipelineBinaryKHR>::call<"vkDestroyPipelineBinaryKHR">))},
        {"vkDestroyShaderEXT",
         DRIVER_FUNCTION((Destroying<void(VKAPI_PTR *)(VkDevice, VkShaderEXT,
                                                       const VkAllocationCallbacks *)>::call<"vkDestroyShaderEXT">))},
        {"vkCreatePipelineBinariesKHR", DRIVER_FUNCTION(createPipelineBinaries)},
        {"vkCreateShadersEXT", DRIVER_FUNCTION(createShaders)},
        {"vkCreateComputePipelines", DRIVER_FUNCTION(createComputePipelines)},
        {"vkCreateRayTracingPipelinesKHR", DRIVER_FUNCTION(createRayTracingPipelines)},
    };
    static const Row instance[]{
        FALLIBLE(vkEnumerateDeviceExtensionProperties),
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
    };
    return {device, instance};
}

// For tests. The n-th command from now on fails; 0: none. Returns the number of commands since the last call.
extern "C" __attribute__((visibility("default"))) uint64_t vellumDriverFailAt(uint64_t n);
extern "C" uint64_t vellumDriverFailAt(uint64_t n)
{
    counting = n != 0;
    failsAt = n;
    return calls.exchange(0);
}
// The command that failed last.
extern "C" __attribute__((visibility("default"))) const char *vellumDriverFailed();
extern "C" const char *vellumDriverFailed()
{
    return failed;
}
// Makes the device lost, or ends that.
extern "C" __attribute__((visibility("default"))) void vellumDriverLose(int value);
extern "C" void vellumDriverLose(int value)
{
    lost = value != 0;
}
// Objects that exist of those that this file counts.
extern "C" __attribute__((visibility("default"))) long vellumDriverObjects();
extern "C" long vellumDriverObjects()
{
    return objects;
}
