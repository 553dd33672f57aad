// SPDX-License-Identifier: Apache-2.0
// Measures builds and the creation of pipelines, on a device with the layer and without.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "gpu/scene.h"
#include "gpu/timer.h"
#include "render/renderer.h"

namespace vellum::cli
{

// A command buffer with one command that builds some structures, which are prepared.
class TimedBuilds
{
public:
    TimedBuilds(gpu::Device &device, std::vector<std::unique_ptr<gpu::Structure>> structures);
    // Submits it and waits.
    gpu::Milliseconds run();
    // The bytes of the structures, and of the scratch memory of their builds.
    struct Bytes {
        VkDeviceSize structures = 0, scratch = 0;
    };
    [[nodiscard]] Bytes bytes() const;

private:
    gpu::Device &device_;
    gpu::GpuTimer timer_;
    std::vector<std::unique_ptr<gpu::Structure>> structures_;
    VkCommandBuffer commands_;
};

// A device of its own, and what is built on it.
class TimedWorld
{
public:
    TimedWorld(const gpu::DeviceInfo &info, std::optional<gpu::Api> api);

    // The build of a top level with `count` instances of one triangle.
    std::unique_ptr<TimedBuilds> top(uint32_t count);
    // The builds of `count` bottom levels of one triangle each.
    std::unique_ptr<TimedBuilds> bottoms(uint32_t count);

private:
    gpu::Device device_;
    gpu::Blas bottom_;
};

// The devices to compare: `bare` of an instance without the layer and without micromaps, `layered` with both.
struct TimedDevices {
    gpu::Device &bare;
    gpu::Device &layered;
};

struct PipelineTiming {
    render::Trace trace = render::Trace::Query;
    bool micromaps = false; // of the pipeline on `layered`; the other one never has them
    double bare = 0;        // median milliseconds
    double layered = 0;
    double ratio = 0; // median
};

// Makes a pipeline and renders one small frame with it, on both devices in turns, as long as `goOn` returns true. Every
// pipeline is new and no pipeline cache is used, but a driver may have a cache of its own: disableShaderCaches.
// Without micromaps and with them. Calls `progress` after each pipeline.
std::array<PipelineTiming, 2> measurePipelines(const TimedDevices &devices, const render::RenderScene &scene,
                                               render::Trace trace, uint32_t level,
                                               const std::function<void()> &progress,
                                               const std::function<bool(size_t pairs)> &goOn);

// Makes the drivers of this process compile every pipeline anew. Must be called before the first Vulkan call.
void disableShaderCaches();

} // namespace vellum::cli
