// Makes SPIR-V with SPV_KHR_opacity_micromap into SPIR-V with SPV_EXT_opacity_micromap, for a driver that has
// VK_EXT_opacity_micromap only.
//
// They have one capability in common, for the ray flag ForceOpacityMicromap2State. What KHR adds, the execution mode
// OpacityMicromapIdKHR with its capability, is taken out: with VK_EXT_opacity_micromap enabled, every ray query uses
// micromaps. Those that KHR lets use none (no mode, or an operand that is false) must not meet geometry with micromaps
// (VUID-vkCmdDispatch-micromap-11636), so for valid programs it is the same.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vellum::spirv
{

struct TranslateResult {
    std::vector<uint32_t> words; // empty: there is nothing to change
    bool queriesForget = false;  // it has ray queries, and no entry point declares anything
};

// What is no SPIR-V, or cut short, stays as it is. Reads nothing outside `words`.
TranslateResult translateToExt(std::span<const uint32_t> words);

} // namespace vellum::spirv
