// SPDX-License-Identifier: Apache-2.0
// Hashes of 64 bits, for what need not withstand an adversary. The same from one run of a program to the next on one
// kind of machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace vellum
{

// FNV-1a, unit by unit.
class Hash
{
public:
    // A byte, or a larger unit as a whole.
    void add(uint64_t unit) { value_ = (value_ ^ unit) * 0x100000001b3u; }
    // The hash of any range whose elements are numbers or bytes, unit by unit.
    template <typename Range>
    static uint64_t of(const Range &range)
    {
        Hash hash;
        for (const auto unit : range)
            hash.add(static_cast<uint64_t>(unit));
        return hash.value_;
    }
    [[nodiscard]] uint64_t value() const { return value_; }

private:
    uint64_t value_ = 0xcbf29ce484222325u;
};

// The hash of many bytes, eight at a time.
inline uint64_t hashBytes(const void *data, size_t bytes, uint64_t seed = 0)
{
    constexpr uint64_t kOdd = 0x9e3779b97f4a7c15;
    uint64_t hash = seed + bytes * kOdd;
    const auto *from = static_cast<const uint8_t *>(data);
    const auto add = [&](size_t count) {
        uint64_t word = 0;
        std::memcpy(&word, from, count);
        hash = (hash ^ word) * kOdd;
        hash ^= hash >> 32;
    };
    for (const uint8_t *end = from + bytes / 8 * 8; from != end; from += 8)
        add(8);
    if (bytes % 8 != 0)
        add(bytes % 8);
    return hash;
}

} // namespace vellum
