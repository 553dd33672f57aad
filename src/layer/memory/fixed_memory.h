// Host memory at an address that is the same in every run.
//
// Rewritten shaders have the addresses of the layer's tables as constants, and a driver's caches know shaders by their
// words. Where device addresses are host addresses, tables that always lie at the same place let a pipeline of one run
// be found again in the next. Nothing but that depends on it: an address that is taken, by another device of this
// process or by anything else, is passed over for the next, and other words are just other keys.
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

    // At most kMostBytes, zeroed. False where none of the addresses is free.
    bool reserve(size_t bytes);
    // Null before that.
    [[nodiscard]] std::byte *data() const { return data_; }

private:
    std::byte *data_ = nullptr;
    size_t bytes_ = 0;
};

} // namespace vellum::layer
