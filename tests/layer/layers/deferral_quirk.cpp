// SPDX-License-Identifier: Apache-2.0
// The quirk "deferred": every deferred creation of pipelines really is (Deferred Host Operations). Each pipeline of a
// call is a piece of work, and as many threads can join as there are pieces; what the call was given is read when they
// do. A thread that finds nothing left to begin is done, while others are still at work.
#include "layers/driver.h"

#include <map>
#include <memory>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Deferral;

struct Work {
    VkPipelineCache cache = VK_NULL_HANDLE;
    uint32_t count = 0;
    const VkRayTracingPipelineCreateInfoKHR *infos = nullptr; // the caller's, and so the next two
    const VkAllocationCallbacks *allocator = nullptr;
    VkPipeline *pipelines = nullptr;
    uint32_t begun = 0, ended = 0;
    VkResult result = VK_SUCCESS;
};

std::mutex mutex;
std::map<VkDeferredOperationKHR, std::shared_ptr<Work>> works;

std::shared_ptr<Work> workOf(VkDeferredOperationKHR operation)
{
    std::lock_guard lock(mutex);
    const auto found = works.find(operation);
    return found == works.end() ? nullptr : found->second;
}

VKAPI_ATTR VkResult VKAPI_CALL createPipelines(VkDevice handle, VkDeferredOperationKHR operation, VkPipelineCache cache,
                                               uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos,
                                               const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    if (operation == VK_NULL_HANDLE)
        return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, count, infos, allocator,
                                                           pipelines);
    auto work = std::make_shared<Work>();
    work->cache = cache;
    work->count = count;
    work->infos = infos;
    work->allocator = allocator;
    work->pipelines = pipelines;
    std::lock_guard lock(mutex);
    works[operation] = std::move(work);
    return VK_OPERATION_DEFERRED_KHR;
}

VKAPI_ATTR VkResult VKAPI_CALL join(VkDevice handle, VkDeferredOperationKHR operation)
{
    const auto work = workOf(operation);
    if (work == nullptr)
        return DRIVER_NEXT(vkDeferredOperationJoinKHR)(handle, operation);
    for (;;) {
        uint32_t piece = 0;
        {
            std::lock_guard lock(mutex);
            if (work->ended == work->count)
                return VK_SUCCESS;
            if (work->begun == work->count)
                return VK_THREAD_DONE_KHR;
            piece = work->begun++;
        }
        VkPipeline pipeline = VK_NULL_HANDLE;
        const VkResult result = DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(
            handle, VK_NULL_HANDLE, work->cache, 1, &work->infos[piece], work->allocator, &pipeline);
        std::lock_guard lock(mutex);
        work->pipelines[piece] = pipeline;
        if (result < 0 || work->result == VK_SUCCESS)
            work->result = result;
        if (++work->ended == work->count)
            return VK_SUCCESS;
    }
}

VKAPI_ATTR uint32_t VKAPI_CALL concurrency(VkDevice handle, VkDeferredOperationKHR operation)
{
    const auto work = workOf(operation);
    if (work == nullptr)
        return DRIVER_NEXT(vkGetDeferredOperationMaxConcurrencyKHR)(handle, operation);
    std::lock_guard lock(mutex);
    return work->count - work->begun;
}

VKAPI_ATTR VkResult VKAPI_CALL result(VkDevice handle, VkDeferredOperationKHR operation)
{
    const auto work = workOf(operation);
    if (work == nullptr)
        return DRIVER_NEXT(vkGetDeferredOperationResultKHR)(handle, operation);
    std::lock_guard lock(mutex);
    return work->ended == work->count ? work->result : VK_NOT_READY;
}

VKAPI_ATTR void VKAPI_CALL destroy(VkDevice handle, VkDeferredOperationKHR operation,
                                   const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        if (const auto gone = works.extract(operation); !gone.empty() && gone.mapped()->ended != gone.mapped()->count)
            report("VUID-vkDestroyDeferredOperationKHR-operation-03436: the operation is not complete");
    }
    DRIVER_NEXT(vkDestroyDeferredOperationKHR)(handle, operation, allocator);
}

} // namespace

driver::LevelRows driver::deferralRows()
{
    static const Row device[]{
        {"vkCreateRayTracingPipelinesKHR", DRIVER_FUNCTION(createPipelines)},
        {"vkDeferredOperationJoinKHR", DRIVER_FUNCTION(join)},
        {"vkGetDeferredOperationMaxConcurrencyKHR", DRIVER_FUNCTION(concurrency)},
        {"vkGetDeferredOperationResultKHR", DRIVER_FUNCTION(result)},
        {"vkDestroyDeferredOperationKHR", DRIVER_FUNCTION(destroy)},
    };
    return {device, {}};
}
