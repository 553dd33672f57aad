// A hash of bytes in memory, the same from one run of a program to the next on one kind of machine.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace vellum
{

// Of 64 bits; equal data has equal hashes.
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
