// SPDX-License-Identifier: Apache-2.0
// std::mt19937 with results of the width that it has.
#pragma once

#include <cstdint>
#include <random>

namespace vellum::test
{

class TestRandom
{
public:
    explicit TestRandom(uint32_t seed) : engine_(seed) {}
    uint32_t operator()() { return static_cast<uint32_t>(engine_()); }
    double uniform(double low, double high) { return low + (high - low) * (*this)() * (1.0 / 4294967296.0); }

private:
    std::mt19937 engine_;
};

} // namespace vellum::test
