// SPDX-License-Identifier: Apache-2.0
// Converts what the application passes to the words that the shaders read (core/gpu_bake.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/gpu_bake.h"
#include "vellum/gpu_bake.h"

namespace vellum::gpubake
{

using Parameters = std::array<uint32_t, shared::kBakeSetWords>;

// Returns whether the description of an image is in range.
bool valid(const GpuAlphaInfo &alpha);

// The wrap number of an address mode; nothing for one that does not exist.
std::optional<uint32_t> wrapOf(VkSamplerAddressMode mode);

// Returns nothing if an argument is out of range, or the data would be 2^32 bytes or more. `output` is null for
// recordSizes().
std::optional<Parameters> parametersOf(const GpuAlphaInfo &alpha, const GpuBakeInput &input,
                                       const GpuBakeOptions &options, const GpuBakeOutput *output,
                                       VkDeviceAddress result);

} // namespace vellum::gpubake
