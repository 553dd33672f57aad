#include "bake/assembly.h"

#include <cstring>
#include <string>

#include "core/large_memory.h"

namespace vellum
{

MicromapAssembly::MicromapAssembly(std::uint64_t bytes) : m_slots(64, -1)
{
    // Room that is never used costs addresses only; a vector that outgrows its room would need both at once.
    reserveLarge(micromap.data, bytes);
}

void MicromapAssembly::grow()
{
    std::vector<std::int32_t> slots(m_slots.size() * 2, -1);
    for (std::size_t i = 0; i < m_hashes.size(); ++i) {
        std::size_t slot = m_hashes[i] & (slots.size() - 1);
        while (slots[slot] >= 0)
            slot = (slot + 1) & (slots.size() - 1);
        slots[slot] = static_cast<std::int32_t>(i);
    }
    m_slots = std::move(slots);
}

std::int32_t MicromapAssembly::add(const std::uint8_t *data, std::uint32_t level, Format format, std::uint64_t hash,
                                   std::uint64_t maxDataBytes)
{
    const std::size_t bytes = packedBytes(level, format);
    std::size_t slot = hash & (m_slots.size() - 1);
    for (; m_slots[slot] >= 0; slot = (slot + 1) & (m_slots.size() - 1)) {
        const auto which = static_cast<std::size_t>(m_slots[slot]);
        const MicromapTriangle &t = micromap.triangles[which];
        if (m_hashes[which] == hash && t.subdivisionLevel == level && t.format == format &&
            std::memcmp(micromap.data.data() + t.dataOffset, data, bytes) == 0)
            return m_slots[slot];
    }
    if (micromap.data.size() + bytes > maxDataBytes)
        throw BakeTooLarge("the micromap would be larger than " + std::to_string(maxDataBytes) +
                           " bytes; choose a lower subdivision level or a budget");
    const auto index = static_cast<std::int32_t>(micromap.triangles.size());
    m_slots[slot] = index;
    m_hashes.push_back(hash);
    micromap.triangles.push_back(
        {static_cast<std::uint32_t>(micromap.data.size()), static_cast<std::uint16_t>(level), format});
    micromap.data.insert(micromap.data.end(), data, data + bytes);
    if (m_hashes.size() * 2 > m_slots.size())
        grow();
    return index;
}

} // namespace vellum
