// SPDX-License-Identifier: Apache-2.0
// The lifetime of the driver's buffers. A command or structure that has an address is recorded with a buffer that
// contains it. If buffers alias each other in memory that may not be the one that the application means, and the
// application may destroy it at any time: only memory must outlive commands by address. So each command buffer and
// structure that uses a buffer found by its address shares the ownership with the application, and the last owner
// destroys the buffer.
//
// The application may also free the memory of such a buffer first, as of any buffer (vkFreeMemory).
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceBuffers;

class DriverBuffer
{
public:
    DriverBuffer(DeviceBuffers &device, VkBuffer handle) : device_(device), handle_(handle) {}
    ~DriverBuffer();
    DriverBuffer(const DriverBuffer &) = delete;
    DriverBuffer &operator=(const DriverBuffer &) = delete;

    // Called when the application destroys the buffer. Without it, the destructor leaves the driver's buffer alone.
    void destroy() { destroyed_ = true; }

private:
    DeviceBuffers &device_;
    const VkBuffer handle_;
    bool destroyed_ = false; // written by an owner, read when no owner is left
};

} // namespace vellum::layer
