// Shader modules, shader objects, compute and graphics pipelines: shaders that trace rays are rewritten on their way to
// the driver.
#pragma once

#include <deque>

#include <vulkan/vulkan.h>

#include "layer/ground/pnext.h"
#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct DevicePipelines;
class DriverIdentifiers;
class DriverStages;

// Makes a create info one as the driver is to see it. What it points to then lives in the other arguments. Without
// emulated micromaps only its identifiers change.
VkResult translate(DevicePipelines &device, VkComputePipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains);
VkResult translate(DevicePipelines &device, VkGraphicsPipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains);

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
