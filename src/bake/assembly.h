// SPDX-License-Identifier: Apache-2.0
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
    explicit MicromapAssembly(uint64_t bytes);

    // The index of a micromap triangle with this data, which becomes part of the micromap unless it is already. Throws
    // BakeTooLarge where that takes it beyond `maxDataBytes`.
    int32_t add(const uint8_t *data, uint32_t level, Format format, uint64_t hash, uint64_t maxDataBytes);

    Micromap micromap;

private:
    void grow();

    std::vector<uint64_t> hashes_; // of each micromap triangle
    std::vector<int32_t> slots_;   // by hash: micromap triangles, -1 where there is none
};

} // namespace vellum
