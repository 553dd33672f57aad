// SPDX-License-Identifier: Apache-2.0
// The output of both programs.
#pragma once

#include <cstdio>

#include "context.h"
#include "leaf.h"

inline constexpr uint32_t kWidth = 200;
inline constexpr uint32_t kHeight = 200;

// Traces rays at the card. Returns the exit code: 0 if each ray went the way of the texture, and most without a shader.
inline int traceAndReport(Context &context, VkDeviceAddress bottomLevel, const std::vector<float> &alpha,
                          const char *extension)
{
    const Counts counts = context.trace(bottomLevel, kWidth, kHeight, alpha);
    const uint32_t rays = kWidth * kHeight;
    std::printf("%s on %s\n", extension, context.deviceName().c_str());
    std::printf("%u of %u rays pass, %u alpha tests, %u rays differ from the texture\n", counts.passed, rays,
                counts.candidates, counts.wrong);
    return counts.wrong == 0 && counts.candidates < rays / 4 ? 0 : 1;
}
