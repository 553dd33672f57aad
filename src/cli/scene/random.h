// Random numbers that are the same on every machine (PCG-XSH-RR by M. O'Neill).
#pragma once

#include <cstdint>

namespace vellum::cli
{

class Random
{
public:
    explicit Random(std::uint64_t seed) : m_state(seed * 6364136223846793005u + 1442695040888963407u) { next(); }

    std::uint32_t next()
    {
        const std::uint64_t old = m_state;
        m_state = old * 6364136223846793005u + 1442695040888963407u;
        const auto mixed = static_cast<std::uint32_t>(((old >> 18u) ^ old) >> 27u);
        const auto turn = static_cast<std::uint32_t>(old >> 59u);
        return (mixed >> turn) | (mixed << ((32 - turn) & 31));
    }
    // In [low, high).
    float between(float low, float high)
    {
        return low + (high - low) * static_cast<float>(next() >> 8) * (1.0f / 16777216.0f);
    }

private:
    std::uint64_t m_state;
};

} // namespace vellum::cli
