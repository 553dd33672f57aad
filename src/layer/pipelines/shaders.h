// Shader modules, shader objects, compute and graphics pipelines: shaders that trace rays are rewritten on their way to
// the driver.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

VKAPI_ATTR VkResult VKAPI_CALL createShaderModule(VkDevice, const VkShaderModuleCreateInfo *,
                                                  const VkAllocationCallbacks *, VkShaderModule *);
VKAPI_ATTR void VKAPI_CALL destroyShaderModule(VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice, VkPipelineCache, uint32_t,
                                                      const VkComputePipelineCreateInfo *,
                                                      const VkAllocationCallbacks *, VkPipeline *);
VKAPI_ATTR VkResult VKAPI_CALL createGraphicsPipelines(VkDevice, VkPipelineCache, uint32_t,
                                                       const VkGraphicsPipelineCreateInfo *,
                                                       const VkAllocationCallbacks *, VkPipeline *);
VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice, uint32_t, const newer::ShaderCreateInfo *,
                                             const VkAllocationCallbacks *, newer::ShaderEXT *);

} // namespace vellum::layer
