// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same on every machine (PCG-XSH-RR by M. O'Neill).
#pragma once

#include <cstdint>

namespace vellum::cli
{

class Random
{
public:
    explicit Random(uint64_t seed) : state_(seed * 6364136223846793005u + 1442695040888963407u) { next(); }

    uint32_t next()
    {
        const uint64_t old = state_;
        state_ = old * 6364136223846793005u + 1442695040888963407u;
        const auto mixed = static_cast<uint32_t>(((old >> 18u) ^ old) >> 27u);
        const auto turn = static_cast<uint32_t>(old >> 59u);
        return (mixed >> turn) | (mixed << ((32 - turn) & 31));
    }
    // In [low, high).
    float between(float low, float high)
    {
        return low + (high - low) * static_cast<float>(next() >> 8) * (1.0f / 16777216.0f);
    }

private:
    uint64_t state_;
};

} // namespace vellum::cli
