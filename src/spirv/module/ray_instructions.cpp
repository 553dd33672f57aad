// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/ray_instructions.h"

#include "spirv/module/opcodes.h"

namespace vellum::spirv
{

std::optional<RayInstruction> rayInstruction(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTraceRayKHR: return RayInstruction{.flags = 2, .payload = 11};
    case kOpTraceRayMotionNV: return RayInstruction{.flags = 2, .payload = 12};
    case kOpHitObjectTraceRayNV:
    case kOpHitObjectTraceRayEXT:
    case kOpHitObjectTraceReorderExecuteEXT: return RayInstruction{.hitObject = 1, .flags = 3, .payload = 12};
    case kOpHitObjectTraceRayMotionNV:
    case kOpHitObjectTraceRayMotionEXT:
    case kOpHitObjectTraceMotionReorderExecuteEXT: return RayInstruction{.hitObject = 1, .flags = 3, .payload = 13};
    case kOpHitObjectRecordMissEXT:
    case kOpHitObjectRecordMissMotionEXT: return RayInstruction{.hitObject = 1, .flags = 2};
    case kOpHitObjectRecordFromQueryEXT: return RayInstruction{.hitObject = 1, .query = 2};
    // These have no flags; those of the ray are 0.
    case kOpHitObjectRecordHitMotionNV:
    case kOpHitObjectRecordHitWithIndexMotionNV:
    case kOpHitObjectRecordMissMotionNV:
    case kOpHitObjectRecordHitNV:
    case kOpHitObjectRecordHitWithIndexNV:
    case kOpHitObjectRecordMissNV: return RayInstruction{.hitObject = 1};
    case kOpHitObjectRecordEmptyNV:
    case kOpHitObjectRecordEmptyEXT: return RayInstruction{.hitObject = 1, .empties = true};
    case kOpHitObjectExecuteShaderNV:
    case kOpHitObjectExecuteShaderEXT:
    case kOpHitObjectReorderExecuteShaderEXT: return RayInstruction{.hitObject = 1, .payload = 2};
    default: return {};
    }
}

} // namespace vellum::spirv
