// Shader modules, shader objects, compute and graphics pipelines: shaders that trace rays are rewritten on their way to
// the driver.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct DevicePipelines;

VkResult createShaderModule(DevicePipelines &, VkDevice, const VkShaderModuleCreateInfo *,
                            const VkAllocationCallbacks *, VkShaderModule *);
void destroyShaderModule(DevicePipelines &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createComputePipelines(DevicePipelines &, VkDevice, VkPipelineCache, uint32_t,
                                const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createGraphicsPipelines(DevicePipelines &, VkDevice, VkPipelineCache, uint32_t,
                                 const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createShaders(DevicePipelines &, VkDevice, uint32_t, const newer::ShaderCreateInfo *,
                       const VkAllocationCallbacks *, newer::ShaderEXT *);

} // namespace vellum::layer
