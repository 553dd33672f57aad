// SPDX-License-Identifier: Apache-2.0
// SPIRV-Tools' validator.
#pragma once

#include <spirv-tools/libspirv.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace vellum::test
{

using Module = std::vector<uint32_t>;

// The oldest environment of Vulkan that takes a module of its version.
spv_target_env environmentOf(const Module &words);

// Empty if valid, else the validator's messages.
std::string validate(const Module &words);

// The module with another mode that has an operand (DenormPreserve) in place of OpacityMicromapIdKHR, its capability
// and the other extension: older SPIR-V Tools do not know SPV_KHR_opacity_micromap.
Module withKnownMode(Module words);

} // namespace vellum::test
