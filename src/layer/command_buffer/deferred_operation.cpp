// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/deferred_operation.h"

#include "layer/base/commands.h"
#include "layer/command_buffer/device_command_buffers.h"

namespace vellum::layer
{
namespace
{

void finish(const DeviceCommandBuffers &device, VkDeferredOperationKHR operation)
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

VkResult deferredOperationJoin(DeviceCommandBuffers &device, VkDevice handle, VkDeferredOperationKHR operation)
{
    const VkResult result = device.driver.next.DeferredOperationJoinKHR(handle, operation);
    if (result == VK_SUCCESS) {
        // Validation layers below register the new objects only when the result is queried.
        device.driver.next.GetDeferredOperationResultKHR(handle, operation);
        finish(device, operation);
    }
    return result;
}

VkResult getDeferredOperationResult(DeviceCommandBuffers &device, VkDevice handle, VkDeferredOperationKHR operation)
{
    const VkResult result = device.driver.next.GetDeferredOperationResultKHR(handle, operation);
    if (result != VK_NOT_READY)
        finish(device, operation);
    return result;
}

void destroyDeferredOperation(DeviceCommandBuffers &device, VkDevice handle, VkDeferredOperationKHR operation,
                              const VkAllocationCallbacks *allocator)
{
    finish(device, operation);
    device.deferredOperations.take(operation);
    device.driver.next.DestroyDeferredOperationKHR(handle, operation, allocator);
}

} // namespace vellum::layer
