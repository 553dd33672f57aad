// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/stored_micromaps.h"

#include <algorithm>
#include <bit>

namespace vellum
{

bool hasMicromapExtension(const JsonValue &extensions)
{
    return std::any_of(kMicromapExtensions.begin(), kMicromapExtensions.end(),
                       [&](const char *name) { return extensions[name].exists(); });
}

bool StoredMicromap::isApproximate() const
{
    return std::all_of(triangles.begin(), triangles.end(),
                       [](const MicromapTriangle &triangle) { return triangle.format == Format::TwoState; });
}

std::optional<Micromap> StoredMicromaps::of(PrimitivePlace place) const
{
    const auto found = primitives.find(place);
    if (found == primitives.end())
        return std::nullopt;
    const PrimitiveMicromap &primitive = found->second;
    const StoredMicromap &source = micromaps[primitive.micromap];
    // The triangles of the source that are used, in their order there.
    std::vector<uint32_t> used;
    for (const int32_t index : primitive.indices)
        if (index >= 0)
            used.push_back(static_cast<uint32_t>(index) + primitive.baseTriangle);
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    Micromap micromap;
    for (const uint32_t triangle : used) {
        MicromapTriangle copy = source.triangles[triangle];
        const auto begin = source.data.begin() + static_cast<ptrdiff_t>(copy.dataOffset);
        const auto end = begin + static_cast<ptrdiff_t>(packedBytes(copy.subdivisionLevel, copy.format));
        copy.dataOffset = static_cast<uint32_t>(micromap.data.size());
        micromap.data.insert(micromap.data.end(), begin, end);
        micromap.triangles.push_back(copy);
    }
    for (const int32_t index : primitive.indices) {
        const auto triangle = static_cast<uint32_t>(index) + primitive.baseTriangle;
        micromap.indices.push_back(
            index < 0 ? index
                      : static_cast<int32_t>(std::lower_bound(used.begin(), used.end(), triangle) - used.begin()));
    }
    return micromap;
}

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
