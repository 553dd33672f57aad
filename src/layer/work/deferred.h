// Deferred operations (VK_KHR_deferred_host_operations): what the driver still reads of ours lives until it is done.
#pragma once

#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Device;

// Something to be done, once, when an operation is complete.
class DeferredWork
{
public:
    virtual ~DeferredWork() = default;
    virtual void finish() = 0;
};

// An operation that the driver has deferred. Several threads may find it complete at the same time; none may go on
// before the work is done.
struct DeferredOperation {
    std::mutex mutex;
    std::unique_ptr<DeferredWork> work; // null where there is none, or it is done
};

VKAPI_ATTR VkResult VKAPI_CALL deferredOperationJoin(VkDevice, VkDeferredOperationKHR);
VKAPI_ATTR VkResult VKAPI_CALL getDeferredOperationResult(VkDevice, VkDeferredOperationKHR);
VKAPI_ATTR void VKAPI_CALL destroyDeferredOperation(VkDevice, VkDeferredOperationKHR, const VkAllocationCallbacks *);

} // namespace vellum::layer
