// SPDX-License-Identifier: Apache-2.0
// Creation of shader modules, pipelines and shader objects: flags about micromaps, and the execution mode of ray
// queries.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "spirv/mode/micromap_mode.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceValidation;

struct ValidatedPipelines {
    // Entry points of modules with the execution mode OpacityMicromapIdKHR.
    HandleMap<VkShaderModule, std::shared_ptr<const std::vector<spirv::EntryPoint>>> modules;
    HandleMap<VkPipeline, std::optional<VkFlags64>> libraries; // their flags
};

// What is checked when they are created.
void checkPipelines(DeviceValidation &, uint32_t count, const VkComputePipelineCreateInfo *);
void checkPipelines(DeviceValidation &, uint32_t count, const VkGraphicsPipelineCreateInfo *);
void checkPipelines(DeviceValidation &, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *);
void checkShaders(DeviceValidation &, uint32_t count, const VkShaderCreateInfoEXT *);
void checkModule(DeviceValidation &, const VkShaderModuleCreateInfo &);
// What is kept of what was created, for pipelines that use it.
void keepModule(DeviceValidation &, const VkShaderModuleCreateInfo &, VkShaderModule);
void keepLibraries(DeviceValidation &, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *, const VkPipeline *);

} // namespace vellum::layer
