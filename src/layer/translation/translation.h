// The commands of VK_KHR_opacity_micromap, and those that know what it adds, by VK_EXT_opacity_micromap.
#pragma once

#include <cstdint>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceTranslation;

// translated_structures.cpp
VkResult createTranslatedStructure(DeviceTranslation &, VkDevice, const VkAccelerationStructureCreateInfoKHR *,
                                   const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
VkResult createTranslatedStructure2(DeviceTranslation &, VkDevice, const VkAccelerationStructureCreateInfo2KHR *,
                                    const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
void destroyTranslatedStructure(DeviceTranslation &, VkDevice, VkAccelerationStructureKHR,
                                const VkAllocationCallbacks *);
VkDeviceAddress getTranslatedStructureAddress(DeviceTranslation &, VkDevice,
                                              const VkAccelerationStructureDeviceAddressInfoKHR *);
void getTranslatedCompatibility(DeviceTranslation &, VkDevice, const VkAccelerationStructureVersionInfoKHR *,
                                VkAccelerationStructureCompatibilityKHR *);

// translated_builds.cpp
void getTranslatedBuildSizes(DeviceTranslation &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                             const VkAccelerationStructureBuildGeometryInfoKHR *, const uint32_t *,
                             VkAccelerationStructureBuildSizesInfoKHR *);
void cmdBuildTranslatedStructures(DeviceTranslation &, VkCommandBuffer, uint32_t,
                                  const VkAccelerationStructureBuildGeometryInfoKHR *,
                                  const VkAccelerationStructureBuildRangeInfoKHR *const *);
void cmdBuildTranslatedStructuresIndirect(DeviceTranslation &, VkCommandBuffer, uint32_t,
                                          const VkAccelerationStructureBuildGeometryInfoKHR *, const VkDeviceAddress *,
                                          const uint32_t *, const uint32_t *const *);
// On the host: a structure without micromaps, as the specification has it.
VkResult buildTranslatedStructures(DeviceTranslation &, VkDevice, VkDeferredOperationKHR, uint32_t,
                                   const VkAccelerationStructureBuildGeometryInfoKHR *,
                                   const VkAccelerationStructureBuildRangeInfoKHR *const *);

// translated_copies.cpp
void cmdCopyTranslatedStructure(DeviceTranslation &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
void cmdCopyTranslatedStructureToMemory(DeviceTranslation &, VkCommandBuffer,
                                        const VkCopyAccelerationStructureToMemoryInfoKHR *);
void cmdCopyMemoryToTranslatedStructure(DeviceTranslation &, VkCommandBuffer,
                                        const VkCopyMemoryToAccelerationStructureInfoKHR *);
VkResult copyTranslatedStructure(DeviceTranslation &, VkDevice, VkDeferredOperationKHR,
                                 const VkCopyAccelerationStructureInfoKHR *);
VkResult copyTranslatedStructureToMemory(DeviceTranslation &, VkDevice, VkDeferredOperationKHR,
                                         const VkCopyAccelerationStructureToMemoryInfoKHR *);
VkResult copyMemoryToTranslatedStructure(DeviceTranslation &, VkDevice, VkDeferredOperationKHR,
                                         const VkCopyMemoryToAccelerationStructureInfoKHR *);

// translated_queries.cpp
void cmdWriteTranslatedProperties(DeviceTranslation &, VkCommandBuffer, uint32_t, const VkAccelerationStructureKHR *,
                                  VkQueryType, VkQueryPool, uint32_t);
VkResult writeTranslatedProperties(DeviceTranslation &, VkDevice, uint32_t, const VkAccelerationStructureKHR *,
                                   VkQueryType, size_t, void *, size_t);

// translated_shaders.cpp
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
