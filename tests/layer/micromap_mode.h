// The execution mode OpacityMicromapIdKHR for shaders whose compiler is older than it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vt
{

// The module with the mode, by a true constant, for each of its entry points, so that its ray queries use micromaps
// where only VK_KHR_opacity_micromap is enabled. A module without ray queries, or with the mode, stays as it is.
std::vector<std::uint32_t> withMicromapMode(std::span<const std::uint32_t> words);

} // namespace vt
