// The micromap as it grows, each different piece of data once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace vellum
{

class MicromapAssembly
{
public:
    // `bytes` of data are not exceeded, as far as is known.
    explicit MicromapAssembly(std::uint64_t bytes);

    // The index of a micromap triangle with this data, which becomes part of the micromap unless it is already. Throws
    // BakeTooLarge where that takes it beyond `maxDataBytes`.
    std::int32_t add(const std::uint8_t *data, std::uint32_t level, Format format, std::uint64_t hash,
                     std::uint64_t maxDataBytes);

    Micromap micromap;

private:
    void grow();

    std::vector<std::uint64_t> m_hashes; // of each micromap triangle
    std::vector<std::int32_t> m_slots;   // by hash: micromap triangles, -1 where there is none
};

} // namespace vellum
