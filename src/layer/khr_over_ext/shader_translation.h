// Shaders and pipelines of VK_KHR_opacity_micromap by VK_EXT_opacity_micromap: translated_shaders.cpp.
#pragma once

#include <cstdint>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceKhrOverExt;

VkResult createTranslatedModule(DeviceKhrOverExt &, VkDevice, const VkShaderModuleCreateInfo *,
                                const VkAllocationCallbacks *, VkShaderModule *);
void destroyTranslatedModule(DeviceKhrOverExt &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createTranslatedComputePipelines(DeviceKhrOverExt &, VkDevice, VkPipelineCache, uint32_t,
                                          const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *,
                                          VkPipeline *);
VkResult createTranslatedGraphicsPipelines(DeviceKhrOverExt &, VkDevice, VkPipelineCache, uint32_t,
                                           const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *,
                                           VkPipeline *);
VkResult createTranslatedRayTracingPipelines(DeviceKhrOverExt &, VkDevice, VkDeferredOperationKHR, VkPipelineCache,
                                             uint32_t, const VkRayTracingPipelineCreateInfoKHR *,
                                             const VkAllocationCallbacks *, VkPipeline *);
VkResult createTranslatedShaders(DeviceKhrOverExt &, VkDevice, uint32_t, const newer::ShaderCreateInfo *,
                                 const VkAllocationCallbacks *, newer::ShaderEXT *);
// Identifiers and keys are the driver's, of the shaders that it gets: these hold nothing of one device or process.
void getTranslatedInfoIdentifier(DeviceKhrOverExt &, VkDevice, const VkShaderModuleCreateInfo *,
                                 VkShaderModuleIdentifierEXT *);
VkResult createTranslatedBinaries(DeviceKhrOverExt &, VkDevice, const newer::PipelineBinaryCreateInfo *,
                                  const VkAllocationCallbacks *, newer::PipelineBinaryHandlesInfo *);
VkResult getTranslatedKey(DeviceKhrOverExt &, VkDevice, const newer::PipelineCreateInfo *, newer::PipelineBinaryKey *);

} // namespace vellum::layer
