// SPDX-License-Identifier: Apache-2.0
// The subsystem of pipelines: shader modules, stages and pipelines as the driver gets them, and the hit records of ray
// tracing pipelines.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/hash.h"
#include "layer/command_buffer/device_command_buffers.h"
#include "layer/pipelines/module_identifiers.h"
#include "layer/pipelines/ray_tracing_pipeline.h"
#include "layer/pipelines/rewrite_cache.h"
#include "layer/state/device_state.h"
#include "spirv/module/scan.h"
#include "vk/newer.h"

namespace vellum::layer
{

// A module with stages of ray tracing pipelines.
struct RayTracingModule {
    std::vector<uint32_t> words; // the application's SPIR-V
    spirv::TracedFlags traced;
    uint64_t original = 0; // hash of the application's code, where validation has changed that
};

// Warnings about shaders, each sent once for the same code: applications create thousands of pipelines from few
// shaders.
class ShaderWarnings
{
public:
    static uint64_t hashOf(std::span<const uint32_t> code) { return hashBytes(code.data(), code.size_bytes()); }
    // Returns whether this is the first call with the message `id` and the hash of this code.
    [[nodiscard]] bool isFirst(const char *id, uint64_t hash)
    {
        std::lock_guard lock(mutex_);
        return sent_.emplace(id, hash).second;
    }

private:
    std::mutex mutex_;
    std::set<std::pair<std::string, uint64_t>> sent_; // message and hash of the code
};

struct DevicePipelines {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    HandleMap<VkShaderModule, std::shared_ptr<const RayTracingModule>> rayTracingModules{};
    HandleMap<VkPipeline, std::shared_ptr<RayTracingPipeline>> rayTracingPipelines{}; // pipelines that use micromaps
    // Libraries of drivers with micromaps of their own, to which the setting assume_micromaps did not add the bit.
    using Flagged = HandleMap<VkPipeline, bool>;
    Flagged librariesWithoutMicromaps{};
    HandleMap<VkShaderModule, bool> tracingModules{}; // true: shaders that trace rays
    TracingIdentifiers tracingIdentifiers{};
    HandleMap<VkPipelineBinaryKHR, HiddenInBinary> pipelineBinaries{};
    RewriteCache rewriteCache{};
    ShaderWarnings shaderWarnings{};
    std::atomic<uint32_t> anyHitStack = 0; // largest stack of the layer's any-hit shaders, in bytes
};

} // namespace vellum::layer
