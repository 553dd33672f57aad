// SPDX-License-Identifier: Apache-2.0
// Measures the commands of a submission on the device.
#pragma once

#include <functional>

#include "gpu/device.h"

namespace vellum::gpu
{

struct Milliseconds {
    double gpu = 0;  // by timestamps; without them the same as `wall`
    double wall = 0; // of everything that GpuTimer::time runs
};

// Two timestamps in a command buffer. Records nothing on a device whose timestamps are not more precise than the host's
// clock (Device::hasTimestamps). Used for one command buffer, which may be submitted repeatedly.
class GpuTimer
{
public:
    explicit GpuTimer(Device &device);

    // Before the commands and after them, outside of render passes.
    void begin(VkCommandBuffer commands) const;
    void end(VkCommandBuffer commands) const;
    // `submit` submits the command buffer and waits until it is done.
    Milliseconds time(const std::function<void()> &submit) const;

private:
    Device &device_;
    QueryPool timestamps_;
};

} // namespace vellum::gpu
