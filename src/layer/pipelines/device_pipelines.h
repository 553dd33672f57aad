// The room of pipelines: shader modules and stages on their way to the driver, ray tracing pipelines and their hit
// records.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "layer/base/vulkan_newer.h"
#include "layer/command_buffer/device_command_buffers.h"
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

inline uint64_t codeHash(std::span<const uint32_t> words)
{
    return std::hash<std::string_view>{}({reinterpret_cast<const char *>(words.data()), words.size_bytes()});
}

// Warnings about shaders, each sent once for the same code: applications make thousands of pipelines of few shaders.
class ShaderWarnings
{
public:
    // Whether the message `id` was not asked for before about code with this hash.
    [[nodiscard]] bool isFirst(const char *id, uint64_t code)
    {
        std::lock_guard lock(mutex_);
        return sent_.emplace(id, code).second;
    }

private:
    std::mutex mutex_;
    std::set<std::pair<std::string, uint64_t>> sent_;
};

struct DevicePipelines {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    HandleMap<VkShaderModule, std::shared_ptr<const RayTracingModule>> rayTracingModules{};
    HandleMap<VkPipeline, std::shared_ptr<RayTracingPipeline>> rayTracingPipelines{}; // those that use micromaps
    HandleMap<VkShaderModule, bool> tracingModules{};                                 // true: shaders that trace rays
    GivenIdentifiers givenIdentifiers{};
    HandleMap<newer::PipelineBinary, HiddenInBinary> pipelineBinaries{};
    AnyHitModules anyHitModules{};
    ShaderWarnings shaderWarnings{};
    std::atomic<uint32_t> anyHitStack = 0; // the most bytes that one of the layer's any-hit shaders takes
};

} // namespace vellum::layer
