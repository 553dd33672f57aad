#include "layer/work/deferred.h"

#include "layer/door/device.h"

namespace vellum::layer
{
namespace
{

void finish(const Device &device, VkDeferredOperationKHR operation)
{
    const auto deferred = device.deferredOperations.get(operation);
    if (!deferred)
        return;
    std::lock_guard lock(deferred->mutex);
    if (deferred->work)
        deferred->work->finish();
    deferred->work.reset();
}

} // namespace

VKAPI_ATTR VkResult VKAPI_CALL deferredOperationJoin(VkDevice handle, VkDeferredOperationKHR operation)
{
    const Device &device = deviceOf(handle);
    const VkResult result = device.next.DeferredOperationJoinKHR(handle, operation);
    if (result == VK_SUCCESS) {
        // Validation layers below learn of what was made only when the result is asked for.
        device.next.GetDeferredOperationResultKHR(handle, operation);
        finish(device, operation);
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL getDeferredOperationResult(VkDevice handle, VkDeferredOperationKHR operation)
{
    const Device &device = deviceOf(handle);
    const VkResult result = device.next.GetDeferredOperationResultKHR(handle, operation);
    if (result != VK_NOT_READY)
        finish(device, operation);
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyDeferredOperation(VkDevice handle, VkDeferredOperationKHR operation,
                                                    const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    finish(device, operation);
    device.deferredOperations.take(operation);
    device.next.DestroyDeferredOperationKHR(handle, operation, allocator);
}

} // namespace vellum::layer
