// SPDX-License-Identifier: Apache-2.0
// SPIR-V numbers that installed headers may be too old to have.
#pragma once

#include <cstdint>

namespace vellum::spirv
{

inline constexpr uint32_t kCapabilityRayTraversalPrimitiveCulling = 4478;
inline constexpr uint32_t kCapabilityRayQueryPositionFetch = 5391;
inline constexpr uint32_t kCapabilityOpacityMicromap = 5381; // EXT and KHR
inline constexpr uint32_t kCapabilityOpacityMicromapExecutionMode = 6032;
inline constexpr uint32_t kExecutionModeOpacityMicromapId = 6031;

// Hit objects (SPV_NV_shader_invocation_reorder, SPV_EXT_shader_invocation_reorder) and motion
// (SPV_NV_ray_tracing_motion_blur)
inline constexpr uint32_t kOpTraceRayMotionNV = 5339;
inline constexpr uint32_t kOpTypeHitObjectNV = 5281;
inline constexpr uint32_t kOpTypeHitObjectEXT = 5313;
inline constexpr uint32_t kOpHitObjectRecordHitMotionNV = 5249;
inline constexpr uint32_t kOpHitObjectRecordHitWithIndexMotionNV = 5250;
inline constexpr uint32_t kOpHitObjectRecordMissMotionNV = 5251;
inline constexpr uint32_t kOpHitObjectTraceRayMotionNV = 5256;
inline constexpr uint32_t kOpHitObjectRecordEmptyNV = 5259;
inline constexpr uint32_t kOpHitObjectTraceRayNV = 5260;
inline constexpr uint32_t kOpHitObjectRecordHitNV = 5261;
inline constexpr uint32_t kOpHitObjectRecordHitWithIndexNV = 5262;
inline constexpr uint32_t kOpHitObjectRecordMissNV = 5263;
inline constexpr uint32_t kOpHitObjectExecuteShaderNV = 5264;
inline constexpr uint32_t kOpHitObjectGetInstanceCustomIndexNV = 5271;
inline constexpr uint32_t kOpHitObjectRecordFromQueryEXT = 5304;
inline constexpr uint32_t kOpHitObjectRecordMissEXT = 5305;
inline constexpr uint32_t kOpHitObjectRecordMissMotionEXT = 5306;
inline constexpr uint32_t kOpHitObjectGetRayFlagsEXT = 5308;
inline constexpr uint32_t kOpHitObjectReorderExecuteShaderEXT = 5310;
inline constexpr uint32_t kOpHitObjectTraceReorderExecuteEXT = 5311;
inline constexpr uint32_t kOpHitObjectTraceMotionReorderExecuteEXT = 5312;
inline constexpr uint32_t kOpHitObjectTraceRayEXT = 5316;
inline constexpr uint32_t kOpHitObjectTraceRayMotionEXT = 5317;
inline constexpr uint32_t kOpHitObjectRecordEmptyEXT = 5318;
inline constexpr uint32_t kOpHitObjectExecuteShaderEXT = 5319;
inline constexpr uint32_t kOpHitObjectGetInstanceCustomIndexEXT = 5326;

inline constexpr uint32_t kOpRayQueryGetIntersectionTriangleVertexPositionsKHR = 5340;
inline constexpr uint32_t kOpUntypedVariableKHR = 4418;

inline constexpr uint32_t kVersion14 = 0x00010400;
inline constexpr uint32_t kVersion15 = 0x00010500;

} // namespace vellum::spirv
