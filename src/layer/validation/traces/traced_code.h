// SPDX-License-Identifier: Apache-2.0
// The shaders of pipelines and shader objects that trace rays. Where a rule about what rays meet may be broken, the
// implementation gets a copy of the shader that sets marks (trace_checks.h).
#pragma once

#include <atomic>
#include <deque>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "layer/base/pnext.h"
#include "layer/memory/device_buffers.h"
#include "layer/validation/traces/trace_checks.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceTraces {
    explicit DeviceTraces(DeviceBuffers &buffers)
        : memory(
              buffers.gpu, 16, [](const GpuContext &) { return VkBufferUsageFlags{VK_BUFFER_USAGE_TRANSFER_DST_BIT}; },
              GpuBuffer::Content::Undefined)
    {
    }
    MemoryPool memory; // of captures
    DescriptorTracker descriptors{};
    TraceMarks marks{};
    std::atomic<bool> deserializes = false; // a structure was deserialized
    VkShaderStageFlags storingStages = 0;   // whose shaders may write to memory
    StructuresByReference byReference{};
    HandleMap<VkShaderModule, std::shared_ptr<const std::vector<uint32_t>>> modules{}; // that trace rays
    HandleMap<VkPipeline, std::shared_ptr<const TracingCode>> pipelines{};
    HandleMap<VkShaderEXT, std::shared_ptr<const TracingCode>> shaders{};
    HandleMap<uint64_t, bool> marked{};           // hashes of code with marks
    HandleMap<VkPipeline, VkFlags64> libraries{}; // flags of pipeline libraries
};

// The stages whose shaders may write to memory, by the features that a device was created with.
VkShaderStageFlags storingStages(const VkDeviceCreateInfo &info);

namespace validation
{

VkResult createShaderModule(DeviceValidation &, VkDevice, const VkShaderModuleCreateInfo *,
                            const VkAllocationCallbacks *, VkShaderModule *);
void destroyShaderModule(DeviceValidation &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createComputePipelines(DeviceValidation &, VkDevice, VkPipelineCache, uint32_t,
                                const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createGraphicsPipelines(DeviceValidation &, VkDevice, VkPipelineCache, uint32_t,
                                 const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createRayTracingPipelines(DeviceValidation &, VkDevice, VkDeferredOperationKHR, VkPipelineCache, uint32_t,
                                   const VkRayTracingPipelineCreateInfoKHR *, const VkAllocationCallbacks *,
                                   VkPipeline *);
void destroyPipeline(DeviceValidation &, VkDevice, VkPipeline, const VkAllocationCallbacks *);
VkResult createShaders(DeviceValidation &, VkDevice, uint32_t, const VkShaderCreateInfoEXT *,
                       const VkAllocationCallbacks *, VkShaderEXT *);
VkResult getShaderBinaryData(DeviceValidation &, VkDevice, VkShaderEXT, size_t *, void *);
void destroyShader(DeviceValidation &, VkDevice, VkShaderEXT, const VkAllocationCallbacks *);

} // namespace validation
} // namespace vellum::layer
