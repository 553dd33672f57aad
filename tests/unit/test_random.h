// std::mt19937 with results of the width that it has.
#pragma once

#include <cstdint>
#include <random>

namespace vellum::test
{

class TestRandom
{
public:
    explicit TestRandom(std::uint32_t seed) : m_engine(seed) {}
    std::uint32_t operator()() { return static_cast<std::uint32_t>(m_engine()); }
    double uniform(double low, double high) { return low + (high - low) * (*this)() * (1.0 / 4294967296.0); }

private:
    std::mt19937 m_engine;
};

} // namespace vellum::test
