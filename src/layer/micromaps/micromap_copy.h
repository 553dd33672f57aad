// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps on the device, queries of their properties, and the commands of VK_EXT_opacity_micromap for them;
// those of VK_KHR_opacity_micromap are in structures/structure_commands.h.
//
// A micromap is self-contained, and nothing in it depends on its location, so a clone copies bytes. Only the device
// knows how many are in use: a handle may be larger than what was built there, and other data may follow it.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include <vulkan/vulkan.h>

#include "core/records.h"
#include "layer/state/micromap_object.h"

namespace vellum::layer
{

struct DeviceMicromaps;
class InjectedWork;

// --- copies that have been checked, whichever extension they came by ---
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

void getDeviceMicromapCompatibility(DeviceMicromaps &, VkDevice, const VkMicromapVersionInfoEXT *,
                                    VkAccelerationStructureCompatibilityKHR *);
void cmdCopyMicromap(DeviceMicromaps &, VkCommandBuffer, const VkCopyMicromapInfoEXT *);
void cmdCopyMicromapToMemory(DeviceMicromaps &, VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT *);
void cmdCopyMemoryToMicromap(DeviceMicromaps &, VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT *);

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
