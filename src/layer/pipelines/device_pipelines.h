// The room of pipelines: shader modules and stages on their way to the driver, ray tracing pipelines and their hit
// records.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "layer/commands/device_commands.h"
#include "layer/ground/vulkan_newer.h"
#include "layer/pipelines/any_hit_modules.h"
#include "layer/pipelines/module_identifiers.h"
#include "layer/pipelines/ray_tracing_pipeline.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{

// A module that may have stages of ray tracing pipelines.
struct RayTracingModule {
    std::vector<uint32_t> words; // SPIR-V, as the application gave it
    spirv::TracedFlags traced;
};

struct DevicePipelines {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceObjects &objects;
    DeviceCommands &commands;
    HandleMap<VkShaderModule, std::shared_ptr<const RayTracingModule>> rayTracingModules{};
    HandleMap<VkPipeline, std::shared_ptr<RayTracingPipeline>> rayTracingPipelines{}; // those that use micromaps
    HandleMap<VkShaderModule, bool> tracingModules{};                                 // true: shaders that trace rays
    GivenIdentifiers givenIdentifiers{};
    HandleMap<newer::PipelineBinary, HiddenInBinary> pipelineBinaries{};
    AnyHitModules anyHitModules{};
    std::atomic<uint32_t> anyHitStack = 0; // the most bytes that one of the layer's any-hit shaders takes
};

} // namespace vellum::layer
