// SPDX-License-Identifier: Apache-2.0
#include "layer/base/pipeline_info.h"

#include <cstring>

#include "spirv/module/numbers.h"

namespace vellum::layer
{

std::optional<uint32_t> executionModelOf(VkShaderStageFlagBits stage)
{
    switch (static_cast<uint32_t>(stage)) {
    case VK_SHADER_STAGE_VERTEX_BIT: return spv::ExecutionModelVertex;
    case VK_SHADER_STAGE_TESSELLATION_CONTROL_BIT: return spv::ExecutionModelTessellationControl;
    case VK_SHADER_STAGE_TESSELLATION_EVALUATION_BIT: return spv::ExecutionModelTessellationEvaluation;
    case VK_SHADER_STAGE_GEOMETRY_BIT: return spv::ExecutionModelGeometry;
    case VK_SHADER_STAGE_FRAGMENT_BIT: return spv::ExecutionModelFragment;
    case VK_SHADER_STAGE_COMPUTE_BIT:
    case VK_SHADER_STAGE_SUBPASS_SHADING_BIT_HUAWEI: return spv::ExecutionModelGLCompute;
    case VK_SHADER_STAGE_TASK_BIT_EXT: return spv::ExecutionModelTaskEXT;
    case VK_SHADER_STAGE_MESH_BIT_EXT: return spv::ExecutionModelMeshEXT;
    case VK_SHADER_STAGE_RAYGEN_BIT_KHR: return spv::ExecutionModelRayGenerationKHR;
    case VK_SHADER_STAGE_INTERSECTION_BIT_KHR: return spv::ExecutionModelIntersectionKHR;
    case VK_SHADER_STAGE_ANY_HIT_BIT_KHR: return spv::ExecutionModelAnyHitKHR;
    case VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR: return spv::ExecutionModelClosestHitKHR;
    case VK_SHADER_STAGE_MISS_BIT_KHR: return spv::ExecutionModelMissKHR;
    case VK_SHADER_STAGE_CALLABLE_BIT_KHR: return spv::ExecutionModelCallableKHR;
    default: return {};
    }
}

std::optional<bool> valueOf(const spirv::MicromapMode &mode, const VkSpecializationInfo *constants)
{
    using When = spirv::MicromapMode::When;
    switch (mode.when) {
    case When::Absent:
    case When::Never: return false;
    case When::Always: return true;
    case When::Specialized: break;
    default: return {};
    }
    for (uint32_t i = 0; constants && i < constants->mapEntryCount; ++i) {
        const VkSpecializationMapEntry &entry = constants->pMapEntries[i];
        VkBool32 value = VK_FALSE;
        if (entry.constantID != mode.constantId || entry.size != sizeof value)
            continue;
        std::memcpy(&value, static_cast<const std::byte *>(constants->pData) + entry.offset, sizeof value);
        return value != VK_FALSE;
    }
    return mode.initial;
}

} // namespace vellum::layer
