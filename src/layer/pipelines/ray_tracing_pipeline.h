// Ray tracing pipelines. In those that use micromaps every hit group has an any-hit shader that looks them up, and ray
// flags that would keep hits from it are hidden from the driver.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
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

// How the ray flags travel that are hidden from the driver, in the code of a pipeline (spirv::HiddenFlags).
struct HiddenInBinary {
    bool known = false;
    uint32_t fixed = 0;
    uint32_t constant = 0;
};

// What the layer keeps of a pipeline that uses micromaps.
struct RayTracingPipeline {
    uint32_t ownGroups = 0; // of the application's, without those of libraries, which come after
    // The driver's pipeline has one group more after these: the one that stands in for null handles.
    bool hasNullGroup = false;
    PooledMemory standIn;         // a hit record with that group's handle
    bool hasBoxes = false;        // has procedural hit groups, its own or of libraries
    uint32_t mostStride = 0;      // the greatest SBT stride of its rays; 15 where it is not known
    HiddenInBinary hidden;        // of its rays
    spirv::PayloadTypes payloads; // where ray flags travel in them

    [[nodiscard]] uint32_t driverGroup(uint32_t group) const
    {
        return hasNullGroup && group >= ownGroups ? group + 1 : group;
    }
};

// pipeline_creation.cpp
VkResult createRayTracingPipelines(DevicePipelines &, VkDevice, VkDeferredOperationKHR, VkPipelineCache, uint32_t,
                                   const VkRayTracingPipelineCreateInfoKHR *, const VkAllocationCallbacks *,
                                   VkPipeline *);
// Calls `use` with a pipeline as the driver would get it. VK_PIPELINE_COMPILE_REQUIRED where there is no code for it.
VkResult
withDriverInfo(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
               const std::function<VkResult(const VkRayTracingPipelineCreateInfoKHR &, const HiddenInBinary &)> &use);
// The code of a stage; nothing where only the driver has it. Valid as long as the stage's module is.
std::span<const uint32_t> stageCode(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage);
// What is known of the rays that it traces.
spirv::TracedFlags tracedBy(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage);
// Sets what decides which hit records its rays may read: hasBoxes, mostStride.
void noteHitRecords(const DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                    RayTracingPipeline &record);
// Rays of one library meet shaders of the others. Those of libraries that are made of code all travel with all hidden
// flags in the payload; binaries have their own way. Reports where a pipeline with the flags of `hidden` cannot be, or
// have, libraries.
bool flagsTravelAlike(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                      const spirv::HiddenFlags &hidden);
// Of a pipeline that the driver has made: writes the handle of the group that stands in for null ones.
void writeStandIn(DevicePipelines &device, VkPipeline pipeline, RayTracingPipeline &record);
// `groups`: of the driver's pipeline, those with any-hit shaders of the layer's.
void measureStacks(DevicePipelines &device, VkPipeline pipeline, const std::vector<uint32_t> &groups);
void destroyPipeline(DevicePipelines &, VkDevice, VkPipeline, const VkAllocationCallbacks *);
VkResult getShaderGroupHandles(DevicePipelines &, VkDevice, VkPipeline, uint32_t, uint32_t, size_t, void *);
VkResult getCaptureReplayShaderGroupHandles(DevicePipelines &, VkDevice, VkPipeline, uint32_t, uint32_t, size_t,
                                            void *);
VkDeviceSize getShaderGroupStackSize(DevicePipelines &, VkDevice, VkPipeline, uint32_t, VkShaderGroupShaderKHR);
void cmdSetRayTracingPipelineStackSize(DevicePipelines &, VkCommandBuffer, uint32_t);

} // namespace vellum::layer
