// SPDX-License-Identifier: Apache-2.0
// The modules of shaders/tracer.glsl, and those of shaders/pipeline_tracer.glsl that trace, in all variants.
#pragma once

#include <cstdint>
#include <span>

#include <vulkan/vulkan.h>

namespace vellum::check
{

// specialized: ray flags by specialization constant 0 instead of each ray's own. byAddress: the acceleration structure
// comes as a device address.
std::span<const uint32_t> queryModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress);
// TracePlan::queryArray
std::span<const uint32_t> queryModuleInArray();
// VK_SHADER_STAGE_RAYGEN_BIT_KHR or VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR
std::span<const uint32_t> tracingModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress);

} // namespace vellum::check
