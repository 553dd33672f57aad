// SPDX-License-Identifier: Apache-2.0
// The names of a case's values in files and accounts.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "check/case/case.h"

namespace vellum::check
{

template <class T>
struct Name {
    T value;
    std::string_view name;
};
using Bit = Name<uint32_t>;

inline constexpr uint64_t kMostStates = uint64_t{1} << 28; // of all micromaps of a case
inline constexpr char kStateLetters[] = "TOto";            // transparent and opaque, in lower case: unknown
inline constexpr std::array kStateNames{"transparent", "opaque", "unknown-transparent", "unknown-opaque"};

inline constexpr std::array kMemoryNames{
    Name<Memory>{Memory::Apart, "apart"},
    Name<Memory>{Memory::Packed, "packed"},
    Name<Memory>{Memory::PackedToTheEnd, "packed-to-the-end"},
};

inline constexpr std::array kBuildCommandNames{
    Name<BuildCommand>{BuildCommand::Device, "device"},
    Name<BuildCommand>{BuildCommand::Indirect, "indirect"},
    Name<BuildCommand>{BuildCommand::Host, "host"},
};

inline constexpr std::array kConditionalNames{
    Name<Conditional>{Conditional::None, "none"},
    Name<Conditional>{Conditional::False, "false"},
    Name<Conditional>{Conditional::InvertedTrue, "inverted-true"},
    Name<Conditional>{Conditional::FalseAtAddress, "false-at-address"},
    Name<Conditional>{Conditional::InvertedTrueAtAddress, "inverted-true-at-address"},
};

inline constexpr std::array kStepNames{
    Name<Step::Kind>{Step::Kind::CloneObject, "clone-object"},
    Name<Step::Kind>{Step::Kind::CompactObject, "compact-object"},
    Name<Step::Kind>{Step::Kind::ReloadObject, "reload-object"},
    Name<Step::Kind>{Step::Kind::UpdateObject, "update-object"},
    Name<Step::Kind>{Step::Kind::RebuildObject, "rebuild-object"},
    Name<Step::Kind>{Step::Kind::ReplaceObject, "replace-object"},
    Name<Step::Kind>{Step::Kind::MoveObject, "move-object"},
    Name<Step::Kind>{Step::Kind::RenameObject, "rename-object"},
    Name<Step::Kind>{Step::Kind::RebuildObjects, "rebuild-objects"},
    Name<Step::Kind>{Step::Kind::CloneMicromap, "clone-micromap"},
    Name<Step::Kind>{Step::Kind::CompactMicromap, "compact-micromap"},
    Name<Step::Kind>{Step::Kind::ReloadMicromap, "reload-micromap"},
    Name<Step::Kind>{Step::Kind::SetStates, "set-states"},
    Name<Step::Kind>{Step::Kind::SetIndices, "set-indices"},
    Name<Step::Kind>{Step::Kind::CloneTop, "clone-top"},
    Name<Step::Kind>{Step::Kind::CompactTop, "compact-top"},
    Name<Step::Kind>{Step::Kind::ReloadTop, "reload-top"},
    Name<Step::Kind>{Step::Kind::UpdateTop, "update-top"},
    Name<Step::Kind>{Step::Kind::RebuildTop, "rebuild-top"},
};
static_assert(kStepNames.size() == static_cast<size_t>(Step::Kind::Count));

inline constexpr std::array kPropertyNames{
    Name<QueryPlan::Property>{QueryPlan::Property::CompactedSize, "compacted-size"},
    Name<QueryPlan::Property>{QueryPlan::Property::SerializationSize, "serialization-size"},
    Name<QueryPlan::Property>{QueryPlan::Property::Size, "size"},
    Name<QueryPlan::Property>{QueryPlan::Property::BottomLevelPointers, "serialization-bottom-level-pointers"},
};
inline constexpr std::array kQueryCommandNames{
    Name<QueryCommand::Kind>{QueryCommand::Kind::Reset, "reset"},
    Name<QueryCommand::Kind>{QueryCommand::Kind::ResetOnHost, "reset-on-host"},
    Name<QueryCommand::Kind>{QueryCommand::Kind::Write, "write"},
    Name<QueryCommand::Kind>{QueryCommand::Kind::Read, "read"},
    Name<QueryCommand::Kind>{QueryCommand::Kind::Copy, "copy"},
    Name<QueryCommand::Kind>{QueryCommand::Kind::WriteOnHost, "write-on-host"},
};
static_assert(kQueryCommandNames.size() == static_cast<size_t>(QueryCommand::Kind::Count));
inline constexpr std::array kQueryTargetNames{
    Name<QueryTarget::Of>{QueryTarget::Of::Object, "object"},
    Name<QueryTarget::Of>{QueryTarget::Of::Micromap, "micromap"},
    Name<QueryTarget::Of>{QueryTarget::Of::Top, "top"},
};

inline constexpr std::array kAddressCommandNames{
    Name<AddressCommand::Kind>{AddressCommand::Kind::Copy, "vkCmdCopyMemoryKHR"},
    Name<AddressCommand::Kind>{AddressCommand::Kind::CopyToImage, "vkCmdCopyMemoryToImageKHR"},
    Name<AddressCommand::Kind>{AddressCommand::Kind::CopyFromImage, "vkCmdCopyImageToMemoryKHR"},
    Name<AddressCommand::Kind>{AddressCommand::Kind::Update, "vkCmdUpdateMemoryKHR"},
    Name<AddressCommand::Kind>{AddressCommand::Kind::Fill, "vkCmdFillMemoryKHR"},
};
static_assert(kAddressCommandNames.size() == static_cast<size_t>(AddressCommand::Kind::Count));
// Formats that every device can copy, whose texels have 1, 2, 4, 8 and 16 bytes.
inline constexpr std::array kImageFormatNames{
    Name<VkFormat>{VK_FORMAT_R8_UINT, "VK_FORMAT_R8_UINT"},
    Name<VkFormat>{VK_FORMAT_R8G8_UINT, "VK_FORMAT_R8G8_UINT"},
    Name<VkFormat>{VK_FORMAT_R8G8B8A8_UNORM, "VK_FORMAT_R8G8B8A8_UNORM"},
    Name<VkFormat>{VK_FORMAT_R16G16B16A16_UINT, "VK_FORMAT_R16G16B16A16_UINT"},
    Name<VkFormat>{VK_FORMAT_R32G32B32A32_UINT, "VK_FORMAT_R32G32B32A32_UINT"},
};

inline constexpr std::array kMethodNames{
    Name<TracePlan::Method>{TracePlan::Method::Query, "query"},
    Name<TracePlan::Method>{TracePlan::Method::Pipeline, "pipeline"},
};
inline constexpr std::array kFlagSourceNames{
    Name<TracePlan::Flags>{TracePlan::Flags::RunTime, "run-time"},
    Name<TracePlan::Flags>{TracePlan::Flags::Specialized, "specialized"},
    Name<TracePlan::Flags>{TracePlan::Flags::Literal, "literal"},
    Name<TracePlan::Flags>{TracePlan::Flags::Selected, "selected"},
    Name<TracePlan::Flags>{TracePlan::Flags::Mixed, "mixed"},
    Name<TracePlan::Flags>{TracePlan::Flags::Computed, "computed"},
};
inline constexpr std::array kModeNames{
    Name<TracePlan::Mode>{TracePlan::Mode::True, "true"},
    Name<TracePlan::Mode>{TracePlan::Mode::False, "false"},
    Name<TracePlan::Mode>{TracePlan::Mode::SpecializedTrue, "specialized-true"},
    Name<TracePlan::Mode>{TracePlan::Mode::SpecializedFalse, "specialized-false"},
    Name<TracePlan::Mode>{TracePlan::Mode::ComputedTrue, "computed-true"},
    Name<TracePlan::Mode>{TracePlan::Mode::ComputedFalse, "computed-false"},
};
inline constexpr std::array kFromNames{
    Name<TracePlan::From>{TracePlan::From::RayGeneration, "ray-generation"},
    Name<TracePlan::From>{TracePlan::From::ClosestHit, "closest-hit"},
    Name<TracePlan::From>{TracePlan::From::Miss, "miss"},
};
inline constexpr std::array kQueryNames{
    Name<TracePlan::Query>{TracePlan::Query::Plain, "plain"},
    Name<TracePlan::Query>{TracePlan::Query::Array, "array"},
    Name<TracePlan::Query>{TracePlan::Query::Functions, "functions"},
    Name<TracePlan::Query>{TracePlan::Query::Again, "again"},
    Name<TracePlan::Query>{TracePlan::Query::Sites, "sites"},
    Name<TracePlan::Query>{TracePlan::Query::Getters, "getters"},
    Name<TracePlan::Query>{TracePlan::Query::Condition, "condition"},
    Name<TracePlan::Query>{TracePlan::Query::Carried, "carried"},
    Name<TracePlan::Query>{TracePlan::Query::Beside, "beside"},
};
inline constexpr std::array kOtherEntryNames{
    Name<OtherEntry>{OtherEntry::None, "none"},
    Name<OtherEntry>{OtherEntry::Empty, "empty"},
    Name<OtherEntry>{OtherEntry::SharedBefore, "shared-before"},
    Name<OtherEntry>{OtherEntry::SharedAfter, "shared-after"},
};
// Stages and groups of PipelineTracerSetup, with decoys.
inline constexpr std::array kTracerStageNames{
    Name<uint32_t>{0, "ray-generation"},
    Name<uint32_t>{1, "miss"},
    Name<uint32_t>{2, "closest-hit"},
    Name<uint32_t>{3, "any-hit"},
    Name<uint32_t>{4, "intersection"},
    Name<uint32_t>{5, "intersection-without-any-hit"},
    Name<uint32_t>{6, "decoy-closest-hit"},
    Name<uint32_t>{7, "decoy-any-hit"},
    Name<uint32_t>{8, "decoy-intersection"},
    Name<uint32_t>{9, "decoy-miss"},
    Name<uint32_t>{10, "relay"},
};
inline constexpr std::array kTracerGroupNames{
    Name<uint32_t>{0, "ray-generation"},
    Name<uint32_t>{1, "miss"},
    Name<uint32_t>{2, "triangles"},
    Name<uint32_t>{3, "triangles-without-any-hit"},
    Name<uint32_t>{4, "triangles-without-closest-hit"},
    Name<uint32_t>{5, "triangles-without-both"},
    Name<uint32_t>{6, "boxes"},
    Name<uint32_t>{7, "boxes-without-any-hit"},
    Name<uint32_t>{8, "boxes-without-closest-hit"},
    Name<uint32_t>{9, "boxes-without-both"},
    Name<uint32_t>{10, "decoy-triangles"},
    Name<uint32_t>{11, "decoy-triangles-with-any-hit"},
    Name<uint32_t>{12, "decoy-boxes"},
    Name<uint32_t>{13, "decoy-miss"},
    Name<uint32_t>{14, "relay"},
};
inline constexpr std::array kHitRecordNames{
    Name<oracle::HitRecord>{oracle::HitRecord::Full, "full"},
    Name<oracle::HitRecord>{oracle::HitRecord::WithoutAnyHit, "without-any-hit"},
    Name<oracle::HitRecord>{oracle::HitRecord::WithoutClosestHit, "without-closest-hit"},
    Name<oracle::HitRecord>{oracle::HitRecord::WithoutBoth, "without-both"},
    Name<oracle::HitRecord>{oracle::HitRecord::Null, "null"},
};
inline constexpr std::array kRecordDataNames{
    Name<RecordData>{RecordData::None, "none"},
    Name<RecordData>{RecordData::Word, "word"},
    Name<RecordData>{RecordData::Words, "words"},
};
inline constexpr std::array kPipelineFlagNames{
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR,
        "VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR"},
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR,
        "VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR"},
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR,
        "VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR"},
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR,
        "VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR"},
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR, "VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR"},
    Bit{VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR, "VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR"},
};
inline constexpr std::array kCreationNames{
    Bit{kCreateDeferred, "deferred"},
    Bit{kCreateCached, "cached"},
    Bit{kCreateSeveral, "several"},
};
inline constexpr std::array kChainedNames{
    Bit{kChainFeedback, "feedback"},
    Bit{kChainRobustness, "robustness"},
    Bit{kChainFlagsFirst, "flags-first"},
};
inline constexpr std::array kTableBarrierNames{
    Bit{kBarrierForTables, "tables"},
    Bit{kBarrierOfMemory, "memory"},
};
inline constexpr std::array kAttributeNames{
    Name<HitAttributes>{HitAttributes::Vec2, "vec2"},
    Name<HitAttributes>{HitAttributes::Scalars, "scalars"},
    Name<HitAttributes>{HitAttributes::Array, "array"},
    Name<HitAttributes>{HitAttributes::Wide, "wide"},
};
inline constexpr std::array kLaunchNames{
    Name<Launch>{Launch::Direct, "direct"},
    Name<Launch>{Launch::Indirect, "indirect"},
    Name<Launch>{Launch::Indirect2, "indirect2"},
};
inline constexpr std::array kStageNames{
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_COMPUTE_BIT, "VK_SHADER_STAGE_COMPUTE_BIT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_VERTEX_BIT, "VK_SHADER_STAGE_VERTEX_BIT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_FRAGMENT_BIT, "VK_SHADER_STAGE_FRAGMENT_BIT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_GEOMETRY_BIT, "VK_SHADER_STAGE_GEOMETRY_BIT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_TASK_BIT_EXT, "VK_SHADER_STAGE_TASK_BIT_EXT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_MESH_BIT_EXT, "VK_SHADER_STAGE_MESH_BIT_EXT"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_RAYGEN_BIT_KHR, "VK_SHADER_STAGE_RAYGEN_BIT_KHR"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_MISS_BIT_KHR, "VK_SHADER_STAGE_MISS_BIT_KHR"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, "VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_ANY_HIT_BIT_KHR, "VK_SHADER_STAGE_ANY_HIT_BIT_KHR"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_INTERSECTION_BIT_KHR, "VK_SHADER_STAGE_INTERSECTION_BIT_KHR"},
    Name<VkShaderStageFlagBits>{VK_SHADER_STAGE_CALLABLE_BIT_KHR, "VK_SHADER_STAGE_CALLABLE_BIT_KHR"},
};

inline constexpr std::array kFormatNames{
    Name<uint16_t>{kTwoState, "VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT"},
    Name<uint16_t>{kFourState, "VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT"},
};
inline constexpr std::array kIndexTypeNames{
    Name<VkIndexType>{VK_INDEX_TYPE_NONE_KHR, "VK_INDEX_TYPE_NONE_KHR"},
    Name<VkIndexType>{VK_INDEX_TYPE_UINT8_EXT, "VK_INDEX_TYPE_UINT8_EXT"},
    Name<VkIndexType>{VK_INDEX_TYPE_UINT16, "VK_INDEX_TYPE_UINT16"},
    Name<VkIndexType>{VK_INDEX_TYPE_UINT32, "VK_INDEX_TYPE_UINT32"},
};
inline constexpr std::array kVertexFormatNames{
    Name<VkFormat>{VK_FORMAT_R32G32B32_SFLOAT, "VK_FORMAT_R32G32B32_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R32G32_SFLOAT, "VK_FORMAT_R32G32_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R16G16B16A16_SFLOAT, "VK_FORMAT_R16G16B16A16_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R16G16_SFLOAT, "VK_FORMAT_R16G16_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R16G16B16A16_SNORM, "VK_FORMAT_R16G16B16A16_SNORM"},
    Name<VkFormat>{VK_FORMAT_R16G16_SNORM, "VK_FORMAT_R16G16_SNORM"},
    Name<VkFormat>{VK_FORMAT_R32G32B32A32_SFLOAT, "VK_FORMAT_R32G32B32A32_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R16G16B16_SFLOAT, "VK_FORMAT_R16G16B16_SFLOAT"},
    Name<VkFormat>{VK_FORMAT_R16G16B16_SNORM, "VK_FORMAT_R16G16B16_SNORM"},
    Name<VkFormat>{VK_FORMAT_R8G8B8A8_SNORM, "VK_FORMAT_R8G8B8A8_SNORM"},
    Name<VkFormat>{VK_FORMAT_R8G8_SNORM, "VK_FORMAT_R8G8_SNORM"},
    Name<VkFormat>{VK_FORMAT_R16G16B16A16_UNORM, "VK_FORMAT_R16G16B16A16_UNORM"},
    Name<VkFormat>{VK_FORMAT_R16G16_UNORM, "VK_FORMAT_R16G16_UNORM"},
    Name<VkFormat>{VK_FORMAT_R8G8B8A8_UNORM, "VK_FORMAT_R8G8B8A8_UNORM"},
    Name<VkFormat>{VK_FORMAT_R8G8_UNORM, "VK_FORMAT_R8G8_UNORM"},
    Name<VkFormat>{VK_FORMAT_A2B10G10R10_UNORM_PACK32, "VK_FORMAT_A2B10G10R10_UNORM_PACK32"},
};
static_assert(kVertexFormatNames.size() == kVertexFormats.size());
inline constexpr std::array kRuleNames{
    Name<uint32_t>{kNever, "never"},
    Name<uint32_t>{kAlways, "always"},
    Name<uint32_t>{kHash, "hash"},
    Name<uint32_t>{kTerminate, "terminate"},
};

inline constexpr std::array kMicromapFlagNames{
    Bit{VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT, "VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT"},
    Bit{VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT, "VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT"},
    Bit{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT, "VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT"},
    Bit{kLossy, "VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR"},
};
inline constexpr std::array kUsageNames{
    Bit{kUsageZeros, "zeros"},
    Bit{kUsageSplit, "split"},
    Bit{kUsageDescending, "descending"},
};
inline constexpr std::array kDataNames{
    Bit{kDataDescending, "descending"},
    Bit{kDataGaps, "gaps"},
    Bit{kDataOverlapping, "overlapping"},
};
inline constexpr auto kAllowDataUpdate =
    VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT};
inline constexpr auto kAllowMicromapUpdate =
    VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT};
// VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DATA_ACCESS_BIT_KHR of VK_KHR_ray_tracing_position_fetch
inline constexpr VkBuildAccelerationStructureFlagsKHR kAllowDataAccess = 0x800;
// Flags of bottom-level and top-level structures. Others follow from the commands that use them.
inline constexpr std::array kStructureFlagNames{
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        "VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR"},
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR,
        "VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR"},
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR, "VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR"},
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR, "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR"},
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR,
        "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR"},
    Bit{kAllowMicromapUpdate, "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT"},
    Bit{kAllowDataUpdate, "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT"},
    Bit{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT,
        "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT"},
    Bit{kAllowDataAccess, "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DATA_ACCESS_BIT_KHR"},
};
inline constexpr std::array kInstanceFlagNames{
    Bit{VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR,
        "VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR"},
    Bit{VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR, "VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR"},
    Bit{VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR, "VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR"},
    Bit{VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR, "VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR"},
    Bit{kFlagTwoState, "VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_EXT"},
    Bit{kFlagDisable, "VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_EXT"},
};
// The names of SPIR-V.
inline constexpr std::array kRayFlagNames{
    Bit{kRayOpaque, "OpaqueKHR"},
    Bit{kRayNoOpaque, "NoOpaqueKHR"},
    Bit{kRayTerminateOnFirstHit, "TerminateOnFirstHitKHR"},
    Bit{kRaySkipClosestHit, "SkipClosestHitShaderKHR"},
    Bit{kRayCullBack, "CullBackFacingTrianglesKHR"},
    Bit{kRayCullFront, "CullFrontFacingTrianglesKHR"},
    Bit{kRayCullOpaque, "CullOpaqueKHR"},
    Bit{kRayCullNoOpaque, "CullNoOpaqueKHR"},
    Bit{kRaySkipTriangles, "SkipTrianglesKHR"},
    Bit{kRaySkipBoxes, "SkipAABBsKHR"},
    Bit{kRayForceTwoState, "ForceOpacityMicromap2StateEXT"},
};

// "?": no such value.
template <class T, size_t N>
constexpr std::string_view nameOf(const std::array<Name<T>, N> &names, T value)
{
    for (const Name<T> &name : names)
        if (name.value == value)
            return name.name;
    return "?";
}

template <class T, size_t N>
constexpr bool isNamed(const std::array<Name<T>, N> &names, T value)
{
    return nameOf(names, value) != "?";
}

template <size_t N>
constexpr uint32_t allOf(const std::array<Bit, N> &bits)
{
    uint32_t all = 0;
    for (const Bit &bit : bits)
        all |= bit.value;
    return all;
}

} // namespace vellum::check
