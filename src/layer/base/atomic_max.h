// SPDX-License-Identifier: Apache-2.0
// An atomic maximum.
#pragma once

#include <atomic>
#include <cstdint>

namespace vellum::layer
{

inline void atomicMax(std::atomic<uint32_t> &greatest, uint32_t value)
{
    uint32_t seen = greatest.load();
    while (seen < value && !greatest.compare_exchange_weak(seen, value)) {
    }
}

} // namespace vellum::layer
