// SPDX-License-Identifier: Apache-2.0
// The subsystem of micromaps on a device: builds, copies, host commands and serialization of emulated micromaps, and
// the input of both extensions.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <mutex>
#include <span>
#include <unordered_map>

#include "core/records.h"
#include "layer/command_buffer/device_command_buffers.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

// The most that a micromap may have.
struct MicromapBound {
    uint64_t triangles = 0;
    VkDeviceSize bytes = 0;
};
// That of any micromap with so many bytes.
MicromapBound boundOf(VkDeviceSize bytes);

// Bounds of the micromaps in large handles, by their addresses. A handle may reach to the end of a buffer of hundreds
// of megabytes, and the scratch memory of a compaction must have tables for all triangles that the micromap may have. A
// bound is that of all micromaps that were ever recorded there: what is recorded last need not be executed yet. Without
// one, the size of the handle is the bound. A micromap with more triangles, which was recorded later, is left as it is;
// bounds only grow, so a copy that is recorded after a query fits in the size that the query reports.
class MicromapBounds
{
public:
    void record(VkDeviceAddress address, const MicromapBound &bound);
    [[nodiscard]] MicromapBound get(VkDeviceAddress address, VkDeviceSize size);

private:
    std::mutex mutex_;
    std::unordered_map<VkDeviceAddress, MicromapBound> bounds_;
};

struct DeviceMicromaps {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    MicromapBounds bounds{};
};

// Invocations of injected work in a loop: enough to keep a GPU busy, or four workgroups for each thread of a CPU.
inline uint32_t enoughInvocations(const Driver &driver)
{
    return driver.threads == 0 ? 1u << 16 : 4u * 64u * std::min(driver.threads, 64u);
}

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

// --- compaction (micromap_compaction.cpp) ---
// A micromap of at most that extent was recorded into, or written by the host to, a micromap's memory.
void recordMicromapBound(DeviceMicromaps &device, const Micromap &micromap, const MicromapBound &bound);
MicromapBound micromapBound(DeviceMicromaps &device, const Micromap &micromap);

// A query of the compacted size.
struct CompactedSize {
    Micromap micromap;
    VkDeviceAddress value = 0; // a 64-bit number, which has the size of the micromap
    bool marked = false;       // the size becomes kMicromapSizeMark modulo 256
};
void recordCompactedSizes(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                          std::span<const CompactedSize> sizes);
// Records a compacting copy. A copy by micromap_move.comp must follow, with the address that is returned: micromaps
// that would not become smaller are copied as they are. 0: there is no memory.
VkDeviceAddress recordCompaction(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                                 const Micromap &source, const Micromap &target);

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
