// Hashes of 64 bits, for what need not withstand an adversary. The same from one run of a program to the next on one kind
// of machine.
#pragma once

#include <algorithm>
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
    void add(std::uint64_t unit) { value_ = (value_ ^ unit) * 0x100000001b3u; }
    // Of anything whose elements are numbers or bytes, unit by unit.
    template <typename Range>
    static std::uint64_t of(const Range &range)
    {
        Hash hash;
        for (const auto unit : range)
            hash.add(static_cast<std::uint64_t>(unit));
        return hash.value_;
    }
    [[nodiscard]] std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_ = 0xcbf29ce484222325u;
};

// Of many bytes, eight at a time.
inline std::uint64_t hashBytes(const void *data, std::size_t bytes, std::uint64_t seed = 0)
{
    constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15;
    std::uint64_t hash = seed + bytes * kOdd;
    for (std::size_t at = 0; at < bytes; at += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, static_cast<const std::uint8_t *>(data) + at, std::min<std::size_t>(8, bytes - at));
        hash = (hash ^ word) * kOdd;
        hash ^= hash >> 32;
    }
    return hash;
}

} // namespace vellum
