// SPDX-License-Identifier: Apache-2.0
// The numbers of SPIR-V that are used here, by the names of its registry. They replace the registry's header, which may
// be too old, and which libvellum is built without. tests/structure/check_spirv_numbers.py compares them with it.
#pragma once

#include <cstdint>

namespace vellum::spv
{

inline constexpr uint32_t MagicNumber = 0x07230203;

// Instructions
inline constexpr uint32_t OpNop = 0;
inline constexpr uint32_t OpUndef = 1;
inline constexpr uint32_t OpSourceContinued = 2;
inline constexpr uint32_t OpSource = 3;
inline constexpr uint32_t OpSourceExtension = 4;
inline constexpr uint32_t OpName = 5;
inline constexpr uint32_t OpMemberName = 6;
inline constexpr uint32_t OpString = 7;
inline constexpr uint32_t OpLine = 8;
inline constexpr uint32_t OpExtension = 10;
inline constexpr uint32_t OpExtInstImport = 11;
inline constexpr uint32_t OpExtInst = 12;
inline constexpr uint32_t OpMemoryModel = 14;
inline constexpr uint32_t OpEntryPoint = 15;
inline constexpr uint32_t OpExecutionMode = 16;
inline constexpr uint32_t OpCapability = 17;
inline constexpr uint32_t OpTypeVoid = 19;
inline constexpr uint32_t OpTypeBool = 20;
inline constexpr uint32_t OpTypeInt = 21;
inline constexpr uint32_t OpTypeFloat = 22;
inline constexpr uint32_t OpTypeVector = 23;
inline constexpr uint32_t OpTypeMatrix = 24;
inline constexpr uint32_t OpTypeImage = 25;
inline constexpr uint32_t OpTypeSampler = 26;
inline constexpr uint32_t OpTypeSampledImage = 27;
inline constexpr uint32_t OpTypeArray = 28;
inline constexpr uint32_t OpTypeRuntimeArray = 29;
inline constexpr uint32_t OpTypeStruct = 30;
inline constexpr uint32_t OpTypePointer = 32;
inline constexpr uint32_t OpTypeFunction = 33;
inline constexpr uint32_t OpTypeForwardPointer = 39;
inline constexpr uint32_t OpConstantTrue = 41;
inline constexpr uint32_t OpConstantFalse = 42;
inline constexpr uint32_t OpConstant = 43;
inline constexpr uint32_t OpConstantComposite = 44;
inline constexpr uint32_t OpConstantNull = 46;
inline constexpr uint32_t OpSpecConstantTrue = 48;
inline constexpr uint32_t OpSpecConstantFalse = 49;
inline constexpr uint32_t OpSpecConstant = 50;
inline constexpr uint32_t OpSpecConstantComposite = 51;
inline constexpr uint32_t OpSpecConstantOp = 52;
inline constexpr uint32_t OpFunction = 54;
inline constexpr uint32_t OpFunctionParameter = 55;
inline constexpr uint32_t OpFunctionEnd = 56;
inline constexpr uint32_t OpFunctionCall = 57;
inline constexpr uint32_t OpVariable = 59;
inline constexpr uint32_t OpLoad = 61;
inline constexpr uint32_t OpStore = 62;
inline constexpr uint32_t OpCopyMemory = 63;
inline constexpr uint32_t OpCopyMemorySized = 64;
inline constexpr uint32_t OpAccessChain = 65;
inline constexpr uint32_t OpInBoundsAccessChain = 66;
inline constexpr uint32_t OpDecorate = 71;
inline constexpr uint32_t OpMemberDecorate = 72;
inline constexpr uint32_t OpDecorationGroup = 73;
inline constexpr uint32_t OpGroupDecorate = 74;
inline constexpr uint32_t OpGroupMemberDecorate = 75;
inline constexpr uint32_t OpVectorExtractDynamic = 77;
inline constexpr uint32_t OpVectorShuffle = 79;
inline constexpr uint32_t OpCompositeConstruct = 80;
inline constexpr uint32_t OpCompositeExtract = 81;
inline constexpr uint32_t OpCopyObject = 83;
inline constexpr uint32_t OpTranspose = 84;
inline constexpr uint32_t OpConvertFToU = 109;
inline constexpr uint32_t OpConvertUToPtr = 120;
inline constexpr uint32_t OpBitcast = 124;
inline constexpr uint32_t OpIAdd = 128;
inline constexpr uint32_t OpIMul = 132;
inline constexpr uint32_t OpLogicalOr = 166;
inline constexpr uint32_t OpLogicalAnd = 167;
inline constexpr uint32_t OpLogicalNot = 168;
inline constexpr uint32_t OpSelect = 169;
inline constexpr uint32_t OpIEqual = 170;
inline constexpr uint32_t OpINotEqual = 171;
inline constexpr uint32_t OpUGreaterThan = 172;
inline constexpr uint32_t OpULessThan = 176;
inline constexpr uint32_t OpFUnordGreaterThanEqual = 191;
inline constexpr uint32_t OpShiftRightLogical = 194;
inline constexpr uint32_t OpShiftLeftLogical = 196;
inline constexpr uint32_t OpBitwiseOr = 197;
inline constexpr uint32_t OpBitwiseXor = 198;
inline constexpr uint32_t OpBitwiseAnd = 199;
inline constexpr uint32_t OpNot = 200;
inline constexpr uint32_t OpBitCount = 205;
inline constexpr uint32_t OpMemoryBarrier = 225;
inline constexpr uint32_t OpPhi = 245;
inline constexpr uint32_t OpLoopMerge = 246;
inline constexpr uint32_t OpSelectionMerge = 247;
inline constexpr uint32_t OpLabel = 248;
inline constexpr uint32_t OpBranch = 249;
inline constexpr uint32_t OpBranchConditional = 250;
inline constexpr uint32_t OpSwitch = 251;
inline constexpr uint32_t OpKill = 252;
inline constexpr uint32_t OpReturn = 253;
inline constexpr uint32_t OpReturnValue = 254;
inline constexpr uint32_t OpUnreachable = 255;
inline constexpr uint32_t OpNoLine = 317;
inline constexpr uint32_t OpModuleProcessed = 330;
inline constexpr uint32_t OpExecutionModeId = 331;
inline constexpr uint32_t OpDecorateId = 332;
inline constexpr uint32_t OpCopyLogical = 400;
inline constexpr uint32_t OpTerminateInvocation = 4416;
inline constexpr uint32_t OpUntypedVariableKHR = 4418;
inline constexpr uint32_t OpTraceRayKHR = 4445;
inline constexpr uint32_t OpIgnoreIntersectionKHR = 4448;
inline constexpr uint32_t OpTerminateRayKHR = 4449;
inline constexpr uint32_t OpTypeRayQueryKHR = 4472;
inline constexpr uint32_t OpRayQueryInitializeKHR = 4473;
inline constexpr uint32_t OpRayQueryTerminateKHR = 4474;
inline constexpr uint32_t OpRayQueryGenerateIntersectionKHR = 4475;
inline constexpr uint32_t OpRayQueryConfirmIntersectionKHR = 4476;
inline constexpr uint32_t OpRayQueryProceedKHR = 4477;
inline constexpr uint32_t OpRayQueryGetIntersectionTypeKHR = 4479;
inline constexpr uint32_t OpHitObjectRecordHitMotionNV = 5249;
inline constexpr uint32_t OpHitObjectRecordHitWithIndexMotionNV = 5250;
inline constexpr uint32_t OpHitObjectRecordMissMotionNV = 5251;
inline constexpr uint32_t OpHitObjectTraceRayMotionNV = 5256;
inline constexpr uint32_t OpHitObjectRecordEmptyNV = 5259;
inline constexpr uint32_t OpHitObjectTraceRayNV = 5260;
inline constexpr uint32_t OpHitObjectRecordHitNV = 5261;
inline constexpr uint32_t OpHitObjectRecordHitWithIndexNV = 5262;
inline constexpr uint32_t OpHitObjectRecordMissNV = 5263;
inline constexpr uint32_t OpHitObjectExecuteShaderNV = 5264;
inline constexpr uint32_t OpHitObjectGetInstanceCustomIndexNV = 5271;
inline constexpr uint32_t OpTypeHitObjectNV = 5281;
inline constexpr uint32_t OpHitObjectRecordFromQueryEXT = 5304;
inline constexpr uint32_t OpHitObjectRecordMissEXT = 5305;
inline constexpr uint32_t OpHitObjectRecordMissMotionEXT = 5306;
inline constexpr uint32_t OpHitObjectGetRayFlagsEXT = 5308;
inline constexpr uint32_t OpHitObjectReorderExecuteShaderEXT = 5310;
inline constexpr uint32_t OpHitObjectTraceReorderExecuteEXT = 5311;
inline constexpr uint32_t OpHitObjectTraceMotionReorderExecuteEXT = 5312;
inline constexpr uint32_t OpTypeHitObjectEXT = 5313;
inline constexpr uint32_t OpHitObjectTraceRayEXT = 5316;
inline constexpr uint32_t OpHitObjectTraceRayMotionEXT = 5317;
inline constexpr uint32_t OpHitObjectRecordEmptyEXT = 5318;
inline constexpr uint32_t OpHitObjectExecuteShaderEXT = 5319;
inline constexpr uint32_t OpHitObjectGetInstanceCustomIndexEXT = 5326;
inline constexpr uint32_t OpTraceRayMotionNV = 5339;
inline constexpr uint32_t OpRayQueryGetIntersectionTriangleVertexPositionsKHR = 5340;
inline constexpr uint32_t OpTypeAccelerationStructureKHR = 5341;
inline constexpr uint32_t OpDecorateString = 5632;
inline constexpr uint32_t OpMemberDecorateString = 5633;
inline constexpr uint32_t OpRayQueryGetRayTMinKHR = 6016;
inline constexpr uint32_t OpRayQueryGetRayFlagsKHR = 6017;
inline constexpr uint32_t OpRayQueryGetIntersectionTKHR = 6018;
inline constexpr uint32_t OpRayQueryGetIntersectionInstanceCustomIndexKHR = 6019;
inline constexpr uint32_t OpRayQueryGetIntersectionInstanceIdKHR = 6020;
inline constexpr uint32_t OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR = 6021;
inline constexpr uint32_t OpRayQueryGetIntersectionGeometryIndexKHR = 6022;
inline constexpr uint32_t OpRayQueryGetIntersectionPrimitiveIndexKHR = 6023;
inline constexpr uint32_t OpRayQueryGetIntersectionBarycentricsKHR = 6024;
inline constexpr uint32_t OpRayQueryGetIntersectionFrontFaceKHR = 6025;
inline constexpr uint32_t OpRayQueryGetIntersectionCandidateAABBOpaqueKHR = 6026;
inline constexpr uint32_t OpRayQueryGetIntersectionObjectRayDirectionKHR = 6027;
inline constexpr uint32_t OpRayQueryGetIntersectionObjectRayOriginKHR = 6028;
inline constexpr uint32_t OpRayQueryGetWorldRayDirectionKHR = 6029;
inline constexpr uint32_t OpRayQueryGetWorldRayOriginKHR = 6030;
inline constexpr uint32_t OpRayQueryGetIntersectionObjectToWorldKHR = 6031;
inline constexpr uint32_t OpRayQueryGetIntersectionWorldToObjectKHR = 6032;

// Capabilities
inline constexpr uint32_t CapabilityShader = 1;
inline constexpr uint32_t CapabilityFloat16 = 9;
inline constexpr uint32_t CapabilityFloat64 = 10;
inline constexpr uint32_t CapabilityInt64 = 11;
inline constexpr uint32_t CapabilityInt16 = 22;
inline constexpr uint32_t CapabilityInt8 = 39;
inline constexpr uint32_t CapabilityRayQueryKHR = 4472;
inline constexpr uint32_t CapabilityRayTraversalPrimitiveCullingKHR = 4478;
inline constexpr uint32_t CapabilityRayTracingKHR = 4479;
inline constexpr uint32_t CapabilityPhysicalStorageBufferAddresses = 5347;
inline constexpr uint32_t CapabilityRayTracingOpacityMicromapKHR = 5381;
inline constexpr uint32_t CapabilityRayQueryPositionFetchKHR = 5391;
inline constexpr uint32_t CapabilityRayTracingOpacityMicromapExecutionModeKHR = 6032;

// Execution models
inline constexpr uint32_t ExecutionModelVertex = 0;
inline constexpr uint32_t ExecutionModelTessellationControl = 1;
inline constexpr uint32_t ExecutionModelTessellationEvaluation = 2;
inline constexpr uint32_t ExecutionModelGeometry = 3;
inline constexpr uint32_t ExecutionModelFragment = 4;
inline constexpr uint32_t ExecutionModelGLCompute = 5;
inline constexpr uint32_t ExecutionModelKernel = 6;
inline constexpr uint32_t ExecutionModelTaskNV = 5267;
inline constexpr uint32_t ExecutionModelMeshNV = 5268;
inline constexpr uint32_t ExecutionModelRayGenerationKHR = 5313;
inline constexpr uint32_t ExecutionModelIntersectionKHR = 5314;
inline constexpr uint32_t ExecutionModelAnyHitKHR = 5315;
inline constexpr uint32_t ExecutionModelClosestHitKHR = 5316;
inline constexpr uint32_t ExecutionModelMissKHR = 5317;
inline constexpr uint32_t ExecutionModelCallableKHR = 5318;
inline constexpr uint32_t ExecutionModelTaskEXT = 5364;
inline constexpr uint32_t ExecutionModelMeshEXT = 5365;

// Execution modes
inline constexpr uint32_t ExecutionModeSubgroupUniformControlFlowKHR = 4421;
inline constexpr uint32_t ExecutionModeMaximallyReconvergesKHR = 6023;
inline constexpr uint32_t ExecutionModeOpacityMicromapIdKHR = 6031;

// Storage classes
inline constexpr uint32_t StorageClassUniformConstant = 0;
inline constexpr uint32_t StorageClassInput = 1;
inline constexpr uint32_t StorageClassUniform = 2;
inline constexpr uint32_t StorageClassPrivate = 6;
inline constexpr uint32_t StorageClassFunction = 7;
inline constexpr uint32_t StorageClassStorageBuffer = 12;
inline constexpr uint32_t StorageClassRayPayloadKHR = 5338;
inline constexpr uint32_t StorageClassHitAttributeKHR = 5339;
inline constexpr uint32_t StorageClassIncomingRayPayloadKHR = 5342;
inline constexpr uint32_t StorageClassPhysicalStorageBuffer = 5349;

// Decorations
inline constexpr uint32_t DecorationSpecId = 1;
inline constexpr uint32_t DecorationBufferBlock = 3;
inline constexpr uint32_t DecorationBuiltIn = 11;
inline constexpr uint32_t DecorationCoherent = 23;
inline constexpr uint32_t DecorationBinding = 33;
inline constexpr uint32_t DecorationDescriptorSet = 34;

// Built-ins
inline constexpr uint32_t BuiltInPrimitiveId = 7;
inline constexpr uint32_t BuiltInInstanceCustomIndexKHR = 5327;
inline constexpr uint32_t BuiltInHitKindKHR = 5333;
inline constexpr uint32_t BuiltInIncomingRayFlagsKHR = 5351;
inline constexpr uint32_t BuiltInRayGeometryIndexKHR = 5352;

// Addressing models
inline constexpr uint32_t AddressingModelLogical = 0;
inline constexpr uint32_t AddressingModelPhysicalStorageBuffer64 = 5348;

// Operands
inline constexpr uint32_t FunctionControlMaskNone = 0;
inline constexpr uint32_t LoopControlDontUnrollMask = 2;
inline constexpr uint32_t LoopControlMaskNone = 0;
inline constexpr uint32_t LoopControlUnrollMask = 1;
inline constexpr uint32_t MemoryAccessAlignedMask = 2;
inline constexpr uint32_t MemoryAccessMakePointerAvailableMask = 8;
inline constexpr uint32_t MemoryAccessMakePointerVisibleMask = 16;
inline constexpr uint32_t MemoryAccessVolatileMask = 1;
inline constexpr uint32_t SelectionControlMaskNone = 0;

} // namespace vellum::spv
