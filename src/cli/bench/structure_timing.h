// SPDX-License-Identifier: Apache-2.0
// How long builds of acceleration structures without micromaps take, on a device with the layer or without.
#pragma once

#include <memory>
#include <vector>

#include "cli/vulkan/gpu_timer.h"
#include "cli/vulkan/resources.h"

namespace vellum::cli
{

class TimedStructure;

// A command buffer with one command that builds some structures.
class TimedBuilds
{
public:
    TimedBuilds(Device &device, const std::vector<std::unique_ptr<TimedStructure>> &structures);
    // Submits it and waits.
    Milliseconds run();

private:
    Device &device_;
    GpuTimer timer_;
    VkCommandBuffer commands_;
};

// A device of its own, and what is built on it.
class TimedWorld
{
public:
    TimedWorld(const DeviceInfo &info, std::optional<MicromapApi> api);
    ~TimedWorld();
    TimedWorld(const TimedWorld &) = delete;
    TimedWorld &operator=(const TimedWorld &) = delete;

    // The build of a top level with `count` instances of one triangle.
    std::unique_ptr<TimedBuilds> top(uint32_t count);
    // The builds of `count` bottom levels of one triangle each.
    std::unique_ptr<TimedBuilds> bottoms(uint32_t count);

private:
    std::unique_ptr<TimedStructure> bottom();

    Device device_;
    Buffer vertices_;
    std::vector<Buffer> instances_;
    std::vector<std::unique_ptr<TimedStructure>> bottoms_, tops_;
};

} // namespace vellum::cli
