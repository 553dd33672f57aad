// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/ray_instructions.h"

#include "spirv/module/numbers.h"

namespace vellum::spirv
{

std::optional<RayInstruction> rayInstruction(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTraceRayKHR: return RayInstruction{.flags = 2, .payload = 11};
    case spv::OpTraceRayMotionNV: return RayInstruction{.flags = 2, .payload = 12};
    case spv::OpHitObjectTraceRayNV:
    case spv::OpHitObjectTraceRayEXT:
    case spv::OpHitObjectTraceReorderExecuteEXT: return RayInstruction{.hitObject = 1, .flags = 3, .payload = 12};
    case spv::OpHitObjectTraceRayMotionNV:
    case spv::OpHitObjectTraceRayMotionEXT:
    case spv::OpHitObjectTraceMotionReorderExecuteEXT: return RayInstruction{.hitObject = 1, .flags = 3, .payload = 13};
    case spv::OpHitObjectRecordMissEXT:
    case spv::OpHitObjectRecordMissMotionEXT: return RayInstruction{.hitObject = 1, .flags = 2};
    case spv::OpHitObjectRecordFromQueryEXT: return RayInstruction{.hitObject = 1, .query = 2};
    // These have no flags; those of the ray are 0.
    case spv::OpHitObjectRecordHitMotionNV:
    case spv::OpHitObjectRecordHitWithIndexMotionNV:
    case spv::OpHitObjectRecordMissMotionNV:
    case spv::OpHitObjectRecordHitNV:
    case spv::OpHitObjectRecordHitWithIndexNV:
    case spv::OpHitObjectRecordMissNV: return RayInstruction{.hitObject = 1};
    case spv::OpHitObjectRecordEmptyNV:
    case spv::OpHitObjectRecordEmptyEXT: return RayInstruction{.hitObject = 1, .empties = true};
    case spv::OpHitObjectExecuteShaderNV:
    case spv::OpHitObjectExecuteShaderEXT:
    case spv::OpHitObjectReorderExecuteShaderEXT: return RayInstruction{.hitObject = 1, .payload = 2};
    default: return {};
    }
}

} // namespace vellum::spirv
