// SPDX-License-Identifier: Apache-2.0
// The subsystem of micromaps on a device: builds, copies, host commands and serialization of emulated micromaps, and
// the input of both extensions.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/records.h"
#include "layer/command_buffer/device_command_buffers.h"
#include "layer/micromaps/micromap_compaction.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

struct DeviceMicromaps {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    MicromapBounds bounds{};
};

// --- builds and copies that have been checked, whichever extension they came by ---
void recordMicromapBuilds(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                          std::span<const MicromapBuild> builds);
// Rejects, with a message under `command`, a copy of a micromap onto itself.
void recordMicromapCopy(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                        const Micromap &source, const Micromap &target, bool compact);
void recordMicromapSave(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &source,
                        VkDeviceAddress target);
// The effect of data that is not a serialized micromap: the target becomes empty, with a message, or is unchanged.
enum class InvalidData { ClearsTarget, KeepsTarget };
void recordMicromapRestore(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &target,
                           VkDeviceAddress source, InvalidData invalid = InvalidData::ClearsTarget);

// Writes a property of a micromap, kQueryMicromap* of core/records.h, to the 64-bit number at `value`.
void recordMicromapProperty(InjectedWork &work, const Driver &driver, const Micromap &micromap, uint32_t kind,
                            VkDeviceAddress value);

// The header of serialized micromaps, for the host. Layout: core/records.h.
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
