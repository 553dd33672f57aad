// SPDX-License-Identifier: Apache-2.0
// The header of serialized micromaps, for the host. Layout: core/records.h.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include <vulkan/vulkan.h>

#include "core/records.h"

namespace vellum::layer
{

struct SerializedMicromapHeader {
    std::array<uint8_t, VK_UUID_SIZE> driverUuid;
    std::array<uint32_t, 4> layoutUuid;
    uint64_t bytes;         // total
    uint64_t micromapBytes; // size of a micromap that it can be deserialized into
    std::array<uint32_t, 4> unused;
};
static_assert(sizeof(SerializedMicromapHeader) == shared::kSerializedMicromapHeaderWords * 4);

inline SerializedMicromapHeader serializedHeader(const std::array<uint8_t, VK_UUID_SIZE> &driverUuid,
                                                 uint64_t micromapBytes)
{
    using namespace shared;
    return {driverUuid,
            {kMicromapLayoutUuid0, kMicromapLayoutUuid1, kMicromapLayoutUuid2, kMicromapLayoutVersion},
            micromapBytes + kSerializedMicromapHeaderWords * 4,
            micromapBytes,
            {}};
}

} // namespace vellum::layer
