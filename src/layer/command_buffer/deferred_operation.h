// SPDX-License-Identifier: Apache-2.0
// Deferred operations (VK_KHR_deferred_host_operations). The layer's structures that a driver reads live until the
// operation is complete.
#pragma once

#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceCommandBuffers;

// Work of the layer that runs once, when an operation is complete.
class DeferredWork
{
public:
    virtual ~DeferredWork() = default;
    virtual void finish() noexcept = 0;
};

// An operation that the driver has deferred. Several threads may find it complete at the same time; all of them wait
// for the work.
struct DeferredOperation {
    std::mutex mutex;
    std::unique_ptr<DeferredWork> work; // null before the driver defers, and when finished
};

} // namespace vellum::layer
