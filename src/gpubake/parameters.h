// From what the application asks for to the words that the shaders read (core/gpu_bake.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/gpu_bake.h"
#include "vellum/gpu_bake.h"

namespace vellum::gpubake
{

using Parameters = std::array<uint32_t, shared::kBakeSetWords>;

// Whether the description of an image is in range.
bool valid(const GpuAlphaInfo &alpha);

// The wrap number of an address mode; nothing for one that does not exist.
std::optional<uint32_t> wrapOf(VkSamplerAddressMode mode);

// A part of the room's data that does not fit 32 bits makes all of it invalid. Nothing where an argument is out of
// range. Without a room: for the sizes.
std::optional<Parameters> parametersOf(const GpuAlphaInfo &alpha, const GpuBakeInput &input,
                                       const GpuBakeOptions &options, const GpuBakeRoom *room, VkDeviceAddress result);

} // namespace vellum::gpubake
