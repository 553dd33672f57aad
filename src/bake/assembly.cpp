// SPDX-License-Identifier: Apache-2.0
#include "bake/assembly.h"

#include <cstring>
#include <string>

#include "core/large_memory.h"

namespace vellum
{

MicromapAssembly::MicromapAssembly(uint64_t bytes) : slots_(64, -1)
{
    // Room that is never used costs addresses only; a vector that outgrows its room would need both at once.
    reserveLarge(micromap.data, bytes);
}

void MicromapAssembly::grow()
{
    std::vector<int32_t> slots(slots_.size() * 2, -1);
    for (size_t i = 0; i < hashes_.size(); ++i) {
        size_t slot = hashes_[i] & (slots.size() - 1);
        while (slots[slot] >= 0)
            slot = (slot + 1) & (slots.size() - 1);
        slots[slot] = static_cast<int32_t>(i);
    }
    slots_ = std::move(slots);
}

int32_t MicromapAssembly::add(const uint8_t *data, uint32_t level, Format format, uint64_t hash, uint64_t maxDataBytes)
{
    const size_t bytes = packedBytes(level, format);
    size_t slot = hash & (slots_.size() - 1);
    for (; slots_[slot] >= 0; slot = (slot + 1) & (slots_.size() - 1)) {
        const auto which = static_cast<size_t>(slots_[slot]);
        const MicromapTriangle &t = micromap.triangles[which];
        if (hashes_[which] == hash && t.subdivisionLevel == level && t.format == format &&
            std::memcmp(micromap.data.data() + t.dataOffset, data, bytes) == 0)
            return slots_[slot];
    }
    if (micromap.data.size() + bytes > maxDataBytes)
        throw BakeTooLarge("the micromap would be larger than " + std::to_string(maxDataBytes) +
                           " bytes; choose a lower subdivision level or a budget");
    const auto index = static_cast<int32_t>(micromap.triangles.size());
    slots_[slot] = index;
    hashes_.push_back(hash);
    micromap.triangles.push_back({static_cast<uint32_t>(micromap.data.size()), static_cast<uint16_t>(level), format});
    micromap.data.insert(micromap.data.end(), data, data + bytes);
    if (hashes_.size() * 2 > slots_.size())
        grow();
    return index;
}

} // namespace vellum
