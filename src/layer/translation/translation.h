// Shaders and pipelines of VK_KHR_opacity_micromap by VK_EXT_opacity_micromap: translated_shaders.cpp.
#pragma once

#include <cstdint>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceTranslation;

VkResult createTranslatedModule(DeviceTranslation &, VkDevice, const VkShaderModuleCreateInfo *,
                                const VkAllocationCallbacks *, VkShaderModule *);
void destroyTranslatedModule(DeviceTranslation &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createTranslatedComputePipelines(DeviceTranslation &, VkDevice, VkPipelineCache, uint32_t,
                                          const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *,
                                          VkPipeline *);
VkResult createTranslatedGraphicsPipelines(DeviceTranslation &, VkDevice, VkPipelineCache, uint32_t,
                                           const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *,
                                           VkPipeline *);
VkResult createTranslatedRayTracingPipelines(DeviceTranslation &, VkDevice, VkDeferredOperationKHR, VkPipelineCache,
                                             uint32_t, const VkRayTracingPipelineCreateInfoKHR *,
                                             const VkAllocationCallbacks *, VkPipeline *);
VkResult createTranslatedShaders(DeviceTranslation &, VkDevice, uint32_t, const newer::ShaderCreateInfo *,
                                 const VkAllocationCallbacks *, newer::ShaderEXT *);
// Identifiers and keys are the driver's, of the shaders that it gets: these hold nothing of one device or process.
void getTranslatedInfoIdentifier(DeviceTranslation &, VkDevice, const VkShaderModuleCreateInfo *,
                                 VkShaderModuleIdentifierEXT *);
VkResult createTranslatedBinaries(DeviceTranslation &, VkDevice, const newer::PipelineBinaryCreateInfo *,
                                  const VkAllocationCallbacks *, newer::PipelineBinaryHandlesInfo *);
VkResult getTranslatedKey(DeviceTranslation &, VkDevice, const newer::PipelineCreateInfo *, newer::PipelineBinaryKey *);

} // namespace vellum::layer
