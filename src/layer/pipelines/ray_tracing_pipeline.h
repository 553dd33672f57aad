// SPDX-License-Identifier: Apache-2.0
// Ray tracing pipelines. In those that use micromaps every hit group has an any-hit shader that looks them up, and the
// driver does not get ray flags that would bypass it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/memory/memory_pool.h"
#include "spirv/module/scan.h"
#include "spirv/payload_types.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

struct DevicePipelines;

inline constexpr uint32_t kGroupHandleBytes = 32; // shaderGroupHandleSize is always this

// How hidden ray flags are passed in the code of a pipeline (spirv::HiddenFlags).
struct HiddenInBinary {
    bool known = false;
    uint32_t fixed = 0;
    uint32_t constant = 0;
};

// A stage of a library, which groups of pipelines that link it may name.
struct LibraryStage {
    uint32_t driverStage = 0;                // its index in the driver's library
    std::optional<spirv::TypeWords> payload; // the payload of its calls (payloadTypes() in micromap_stages.h)
};

// A pipeline that uses micromaps.
struct RayTracingPipeline {
    uint32_t ownGroups = 0; // groups of the create info; those of libraries follow
    // True if the driver's pipeline has the layer's hit group, which replaces null handles, after ownGroups.
    bool hasNullGroup = false;
    PooledMemory standIn;         // hit record with that group's handle
    bool hasBoxes = false;        // has procedural hit groups, including those of libraries
    uint32_t mostStride = 0;      // largest SBT stride of its rays; 15 if unknown
    HiddenInBinary hidden;        // how the ray flags of its rays travel
    spirv::PayloadTypes payloads; // of its rays, if flags travel in payloads
    // For a library: the application's stages, then those of its own libraries, and the number of the driver's.
    std::vector<LibraryStage> stages;
    uint32_t driverStages = 0;

    [[nodiscard]] uint32_t driverGroup(uint32_t group) const
    {
        return hasNullGroup && group >= ownGroups ? group + 1 : group;
    }
};

// The application's SPIR-V of a stage; empty if the stage has a module identifier. Valid as long as the stage's module.
std::span<const uint32_t> stageCode(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage);
// The flags of the rays that a stage traces.
spirv::TracedFlags tracedBy(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage);
// Checks that the libraries of a pipeline, and a pipeline that is a library, have all hidden ray flags in the payload:
// rays of one library meet shaders of the others. Binaries may have some as constants. Reports an error otherwise.
bool checkFlagTransport(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                        const spirv::HiddenFlags &hidden);
// Writes the hit record that replaces null ones, with the handle of the layer's hit group.
void writeStandIn(DevicePipelines &device, VkPipeline pipeline, RayTracingPipeline &record);
// Measures the stacks of the layer's any-hit shaders. `groups`: those of the driver's pipeline that have one.
void measureStacks(DevicePipelines &device, VkPipeline pipeline, const std::vector<uint32_t> &groups);

} // namespace vellum::layer
