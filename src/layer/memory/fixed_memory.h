// SPDX-License-Identifier: Apache-2.0
// Host memory at an address that is the same in every run.
//
// Rewritten shaders contain the addresses of the layer's tables as constants, and a driver's caches identify shaders by
// their words. If device addresses are host addresses, tables at the same address in every run let the next run find
// the pipelines of this one. Nothing else depends on it: if an address is taken, by another device of the process or by
// anything else, the next one is tried, and other words are only other keys.
#pragma once

#include <cstddef>

namespace vellum::layer
{

class FixedMemory
{
public:
    FixedMemory() = default;
    ~FixedMemory();
    FixedMemory(const FixedMemory &) = delete;
    FixedMemory &operator=(const FixedMemory &) = delete;

    static constexpr size_t kAlignment = 65536; // of addresses, and of sizes
    static constexpr size_t kMostBytes = size_t{1} << 24;

    // Reserves at most kMostBytes, zeroed. Returns false if none of the addresses is free.
    bool reserve(size_t bytes);
    // Null before reserve() succeeded.
    [[nodiscard]] std::byte *data() const { return data_; }

private:
    std::byte *data_ = nullptr;
    size_t bytes_ = 0;
};

} // namespace vellum::layer
