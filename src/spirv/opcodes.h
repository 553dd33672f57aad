// The SPIR-V numbers, and those that installed headers may be too old to have.
#pragma once

#include <cstdint>

#define SPV_ENABLE_UTILITY_CODE
#include <spirv/unified1/spirv.hpp>
#undef SPV_ENABLE_UTILITY_CODE

namespace vellum::spirv
{

inline constexpr std::uint32_t kCapabilityRayTraversalPrimitiveCulling = 4478;
inline constexpr std::uint32_t kCapabilityRayQueryPositionFetch = 5391;
inline constexpr std::uint32_t kCapabilityOpacityMicromap = 5381; // EXT and KHR
inline constexpr std::uint32_t kCapabilityOpacityMicromapExecutionMode = 6032;
inline constexpr std::uint32_t kExecutionModeOpacityMicromapId = 6031;

inline constexpr std::uint32_t kVersion14 = 0x00010400;
inline constexpr std::uint32_t kVersion15 = 0x00010500;

} // namespace vellum::spirv
