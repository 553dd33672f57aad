#include "cli/inspect/state_counter.h"

#include <bit>

namespace vellum::cli
{
namespace
{

constexpr std::size_t kBlock = 64; // bytes

// For each value of a byte, how many of its four 2-bit states are which.
constexpr auto kStatesOfByte = [] {
    std::array<std::array<std::uint8_t, 4>, 256> counts{};
    for (std::size_t byte = 0; byte < counts.size(); ++byte)
        for (unsigned shift = 0; shift < 8; shift += 2)
            ++counts[byte][(byte >> shift) & 3];
    return counts;
}();

void addByte(StateCounts &counts, std::uint8_t byte)
{
    for (std::size_t s = 0; s < 4; ++s)
        counts[s] += kStatesOfByte[byte][s];
}

} // namespace

StateCounter::StateCounter(std::span<const std::uint8_t> data) : m_data(data)
{
    m_four.reserve(data.size() / kBlock + 1);
    m_two.reserve(data.size() / kBlock + 1);
    StateCounts four{};
    std::uint64_t two = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        if (i % kBlock == 0) {
            m_four.push_back(four);
            m_two.push_back(two);
        }
        addByte(four, data[i]);
        two += static_cast<unsigned>(std::popcount(data[i]));
    }
    if (data.size() % kBlock == 0) { // a range may end here
        m_four.push_back(four);
        m_two.push_back(two);
    }
}

StateCounts StateCounter::before(std::uint64_t position, Format format) const
{
    const std::uint64_t perByte = format == Format::TwoState ? 8 : 4;
    const auto byte = static_cast<std::size_t>(position / perByte);
    const std::size_t block = byte / kBlock;
    const auto rest = static_cast<unsigned>(position % perByte);
    StateCounts counts{};
    if (format == Format::TwoState) {
        std::uint64_t opaque = m_two[block];
        for (std::size_t i = block * kBlock; i < byte; ++i)
            opaque += static_cast<unsigned>(std::popcount(m_data[i]));
        if (rest != 0)
            opaque += static_cast<unsigned>(std::popcount(m_data[byte] & ((1u << rest) - 1)));
        counts[static_cast<std::size_t>(State::Opaque)] = opaque;
        counts[static_cast<std::size_t>(State::Transparent)] = position - opaque;
        return counts;
    }
    counts = m_four[block];
    for (std::size_t i = block * kBlock; i < byte; ++i)
        addByte(counts, m_data[i]);
    for (unsigned i = 0; i < rest; ++i)
        ++counts[(m_data[byte] >> (2 * i)) & 3];
    return counts;
}

StateCounts StateCounter::count(const MicromapTriangle &triangle, std::uint64_t first, std::uint64_t count) const
{
    const std::uint64_t origin = std::uint64_t{triangle.dataOffset} * (triangle.format == Format::TwoState ? 8 : 4);
    StateCounts counts = before(origin + first + count, triangle.format);
    const StateCounts skipped = before(origin + first, triangle.format);
    for (std::size_t s = 0; s < 4; ++s)
        counts[s] -= skipped[s];
    return counts;
}

} // namespace vellum::cli
