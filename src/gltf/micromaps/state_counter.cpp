// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/state_counter.h"

#include <bit>

namespace vellum
{
namespace
{

constexpr size_t kBlock = 64; // bytes

// For each value of a byte, the count of each state among its four 2-bit states.
constexpr auto kStatesOfByte = [] {
    std::array<std::array<uint8_t, 4>, 256> counts{};
    for (size_t byte = 0; byte < counts.size(); ++byte)
        for (unsigned shift = 0; shift < 8; shift += 2)
            ++counts[byte][(byte >> shift) & 3];
    return counts;
}();

void addByte(StateCounts &counts, uint8_t byte)
{
    for (size_t s = 0; s < 4; ++s)
        counts[s] += kStatesOfByte[byte][s];
}

} // namespace

StateCounter::StateCounter(std::span<const uint8_t> data) : data_(data)
{
    four_.reserve(data.size() / kBlock + 1);
    two_.reserve(data.size() / kBlock + 1);
    StateCounts four{};
    uint64_t two = 0;
    for (size_t i = 0; i < data.size(); ++i) {
        if (i % kBlock == 0) {
            four_.push_back(four);
            two_.push_back(two);
        }
        addByte(four, data[i]);
        two += static_cast<unsigned>(std::popcount(data[i]));
    }
    if (data.size() % kBlock == 0) { // a range may end here
        four_.push_back(four);
        two_.push_back(two);
    }
}

StateCounts StateCounter::before(uint64_t position, Format format) const
{
    const uint64_t perByte = format == Format::TwoState ? 8 : 4;
    const auto byte = static_cast<size_t>(position / perByte);
    const size_t block = byte / kBlock;
    const auto rest = static_cast<unsigned>(position % perByte);
    StateCounts counts{};
    if (format == Format::TwoState) {
        uint64_t opaque = two_[block];
        for (size_t i = block * kBlock; i < byte; ++i)
            opaque += static_cast<unsigned>(std::popcount(data_[i]));
        if (rest != 0)
            opaque += static_cast<unsigned>(std::popcount(data_[byte] & ((1u << rest) - 1)));
        counts[static_cast<size_t>(State::Opaque)] = opaque;
        counts[static_cast<size_t>(State::Transparent)] = position - opaque;
        return counts;
    }
    counts = four_[block];
    for (size_t i = block * kBlock; i < byte; ++i)
        addByte(counts, data_[i]);
    for (unsigned i = 0; i < rest; ++i)
        ++counts[(data_[byte] >> (2 * i)) & 3];
    return counts;
}

StateCounts StateCounter::count(const MicromapTriangle &triangle, uint64_t first, uint64_t count) const
{
    const uint64_t origin = uint64_t{triangle.dataOffset} * (triangle.format == Format::TwoState ? 8 : 4);
    StateCounts counts = before(origin + first + count, triangle.format);
    const StateCounts skipped = before(origin + first, triangle.format);
    for (size_t s = 0; s < 4; ++s)
        counts[s] -= skipped[s];
    return counts;
}

} // namespace vellum
