// SPDX-License-Identifier: Apache-2.0
// Translates SPIR-V with SPV_KHR_opacity_micromap to SPIR-V with SPV_EXT_opacity_micromap, for a driver that has
// VK_EXT_opacity_micromap only.
//
// Both have the capability for the ray flag ForceOpacityMicromap2State. The execution mode OpacityMicromapIdKHR and its
// capability, which EXT does not have, are removed: with VK_EXT_opacity_micromap every ray query uses micromaps. Ray
// queries that use none by KHR (without the mode, or with a false operand) must not meet geometry with micromaps
// (VUID-vkCmdDispatch-micromap-11636), so valid programs behave the same.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vellum::spirv
{

struct TranslateResult {
    std::vector<uint32_t> words; // empty if nothing changes
    bool queriesForget = false;  // it has ray queries, and no entry point has the execution mode
};

// Words that are not SPIR-V are unchanged, and so is an incomplete end. Reads nothing outside `words`.
TranslateResult translateToExt(std::span<const uint32_t> words);

} // namespace vellum::spirv
