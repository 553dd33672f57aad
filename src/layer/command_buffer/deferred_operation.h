// Deferred operations (VK_KHR_deferred_host_operations): what the driver still reads of ours lives until it is done.
#pragma once

#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceCommandBuffers;

// Something to be done, once, when an operation is complete.
class DeferredWork
{
public:
    virtual ~DeferredWork() = default;
    virtual void finish() noexcept = 0;
};

// An operation that the driver has deferred. Several threads may find it complete at the same time; none may go on
// before the work is done.
struct DeferredOperation {
    std::mutex mutex;
    std::unique_ptr<DeferredWork> work; // null where there is none, or it is done
};

VkResult deferredOperationJoin(DeviceCommandBuffers &, VkDevice, VkDeferredOperationKHR);
VkResult getDeferredOperationResult(DeviceCommandBuffers &, VkDevice, VkDeferredOperationKHR);
void destroyDeferredOperation(DeviceCommandBuffers &, VkDevice, VkDeferredOperationKHR, const VkAllocationCallbacks *);

} // namespace vellum::layer
