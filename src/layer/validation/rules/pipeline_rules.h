// SPDX-License-Identifier: Apache-2.0
// Creation of shader modules, pipelines and shader objects: flags about micromaps, and the execution mode of ray
// queries.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/input/creations.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceModel;

// Check the create infos. The results state which objects may be created.
input::Pipelines checkPipelines(DeviceModel &, uint32_t count, const VkComputePipelineCreateInfo *);
input::Pipelines checkPipelines(DeviceModel &, uint32_t count, const VkGraphicsPipelineCreateInfo *);
input::Pipelines checkPipelines(DeviceModel &, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *);
input::Pipelines checkShaders(DeviceModel &, uint32_t count, const VkShaderCreateInfoEXT *);
void checkModule(DeviceModel &, const VkShaderModuleCreateInfo &);
// These keep facts about created objects, for pipelines that use them.
void keepModule(DeviceModel &, const VkShaderModuleCreateInfo &, VkShaderModule);
void keepLibraries(DeviceModel &, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *, const VkPipeline *);

} // namespace vellum::layer
