// SPDX-License-Identifier: Apache-2.0
// The rules of creating micromaps, acceleration structures, pipelines and shader objects.
#pragma once

#include "layer/input/creations.h"
#include "layer/rules/rule.h"

namespace vellum::layer::rules
{

// Parses and checks the creation. `bufferSize`: of the buffer that it names.
input::Creation checkCreation(const InputCheck &check, const VkMicromapCreateInfoEXT &info, VkDeviceSize bufferSize);
input::Creation checkCreation(const InputCheck &check, const VkAccelerationStructureCreateInfoKHR &info,
                              VkDeviceSize bufferSize);
input::Creation checkCreation(const InputCheck &check, const VkAccelerationStructureCreateInfo2KHR &info);

input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count, const VkComputePipelineCreateInfo *infos);
input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count, const VkGraphicsPipelineCreateInfo *infos);
// Returns whether a library was created with the micromap bit; nothing: it is not known.
using UsesMicromaps = std::function<std::optional<bool>(VkPipeline)>;
input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count,
                                const VkRayTracingPipelineCreateInfoKHR *infos, const UsesMicromaps &libraries);
input::Pipelines checkShaders(const RuleDevice &device, uint32_t count, const VkShaderCreateInfoEXT *infos);

} // namespace vellum::layer::rules
