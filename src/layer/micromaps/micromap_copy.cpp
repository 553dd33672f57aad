// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps on the device, queries of their properties, and the commands of VK_EXT_opacity_micromap for them;
// those of VK_KHR_opacity_micromap are in structures/structure_commands.cpp.
//
// A micromap is self-contained, and nothing in it depends on its location, so a clone copies bytes. Only the device
// knows how many are in use: a handle may be larger than what was built there, and other data may follow it.
#include <algorithm>
#include <cstring>
#include <string>

#include "core/align.h"
#include "core/records.h"
#include "layer/base/commands.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/copies.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

MicromapMovePush movePush(const DeviceMicromaps &device, const Micromap &micromap, uint32_t mode)
{
    MicromapMovePush push{};
    push.micromap = micromapAddress(device.driver, micromap);
    push.micromapBytes = micromap.size;
    push.root = device.objects.root.address();
    push.mode = mode;
    return push;
}

// Only the device knows how many bytes are in use: a handle may be far larger than what was built there.
void move(InjectedWork &work, const Driver &driver, MicromapMovePush push)
{
    const uint64_t units = push.micromapBytes / kDataUnitBytes;
    const uint64_t invocations = (units + kMoveUnitsPerInvocation - 1) / kMoveUnitsPerInvocation;
    push.invocations =
        static_cast<uint32_t>(std::clamp<uint64_t>(alignUp(invocations, 64), 64, enoughInvocations(driver)));
    work.barrier();
    work.dispatch(InjectedShader::MicromapMove, push, push.invocations, 64);
    work.barrier(true);
}

// Returns whether the memory is smaller than any micromap, as it is if the application creates it by a failed size
// query, which returns 0. No shader may read its header.
bool tooSmall(const Micromap &micromap)
{
    return micromap.size < kMicromapHeaderWords * 4;
}

void rejectTooSmall(const DeviceMicromaps &device, const char *command, const Micromap &micromap, bool target)
{
    device.driver.report().error(target ? "VELLUM-micromap-copy-size" : "VELLUM-micromap-not-constructed",
                                 std::string(command) + ": " + (target ? "dst" : "src") + " has " +
                                     std::to_string(micromap.size) + " bytes, less than any micromap",
                                 micromap.object.type, micromap.object.handle);
}

} // namespace

void recordMicromapCopy(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                        const Micromap &source, const Micromap &target, bool compact)
{
    if (tooSmall(source) || tooSmall(target))
        return rejectTooSmall(device, command, tooSmall(source) ? source : target, !tooSmall(source));
    // Handles may overlap as long as the bytes in use do not; the shader checks these.
    if (source.buffer == target.buffer && source.offset == target.offset) {
        device.driver.report().error("VELLUM-micromap-copy-overlap", std::string(command) + ": src and dst overlap",
                                     target.object.type, target.object.handle);
        return;
    }
    MicromapMovePush push = movePush(device, target, kMoveCopy);
    push.serialized = micromapAddress(device.driver, source);
    push.serializedBytes = source.size;
    InjectedWork work(device.commands, commandBuffer);
    if (!work.prepare(InjectedShader::MicromapMove))
        return;
    if (compact) {
        push.compaction = recordCompaction(device, commandBuffer, work, source, target);
        if (push.compaction == 0) {
            device.driver.report().error("VELLUM-out-of-memory", std::string(command) + ": no memory for a compaction",
                                         target.object.type, target.object.handle);
            return;
        }
    }
    recordMicromapBound(device, target, micromapBound(device, source));
    move(work, device.driver, push);
}

void recordMicromapSave(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &source,
                        VkDeviceAddress target)
{
    if (tooSmall(source))
        return rejectTooSmall(device, "serialization of a micromap", source, false);
    const bool structure = source.object.type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR;
    MicromapMovePush push = movePush(device, source, kMoveSerialize | (structure ? kMoveMarked : 0));
    push.serialized = target;
    push.serializedBytes = device.buffers.addresses.bytesFrom(target);
    static_assert(sizeof push.driverUuid == VK_UUID_SIZE);
    std::memcpy(push.driverUuid, device.driver.driverUuid.data(), VK_UUID_SIZE);
    InjectedWork work(device.commands, commandBuffer);
    move(work, device.driver, push);
}

namespace
{

// The bound of a micromap in serialized data: as the data states now, if it is complete and the host can read it.
MicromapBound boundOfSerialized(const DeviceMicromaps &device, VkDeviceAddress data)
{
    struct {
        SerializedMicromapHeader serialized;
        std::array<uint32_t, kMicromapHeaderUnits + 1> micromap;
    } headers;
    const AddressMap::Location location = device.buffers.addresses.find(data);
    const SerializedMicromapHeader own = serializedHeader(device.driver.driverUuid, 0);
    if (!location.buffer || location.bytes < sizeof headers ||
        !device.buffers.host.peek(location.buffer, location.offset, &headers, sizeof headers) ||
        headers.serialized.layoutUuid != own.layoutUuid)
        return boundOf(device.buffers.addresses.bytesFrom(data));
    return {headers.micromap[kMicromapHeaderTriangles], headers.serialized.micromapBytes};
}

} // namespace

void recordMicromapRestore(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &target,
                           VkDeviceAddress source, InvalidData invalid)
{
    if (tooSmall(target))
        return rejectTooSmall(device, "deserialization of a micromap", target, true);
    MicromapMovePush push =
        movePush(device, target, kMoveDeserialize | (invalid == InvalidData::KeepsTarget ? kMoveOnlyMicromaps : 0));
    push.serialized = source;
    push.serializedBytes = device.buffers.addresses.bytesFrom(source);
    recordMicromapBound(device, target, boundOfSerialized(device, source));
    InjectedWork work(device.commands, commandBuffer);
    move(work, device.driver, push);
}

void recordMicromapProperty(InjectedWork &work, const Driver &driver, const Micromap &micromap, uint32_t kind,
                            VkDeviceAddress value)
{
    QueryValuePush push{};
    push.target = value;
    push.micromap = micromapAddress(driver, micromap);
    push.micromapBytes = micromap.size;
    push.kind = kind;
    work.dispatch(InjectedShader::QueryValue, push, 1, 1);
}

void getDeviceMicromapCompatibility(DeviceMicromaps &device, VkDevice, const VkMicromapVersionInfoEXT *info,
                                    VkAccelerationStructureCompatibilityKHR *compatibility)
{
    const SerializedMicromapHeader own = serializedHeader(device.driver.driverUuid, 0);
    *compatibility = std::memcmp(info->pVersionData, &own, 2 * VK_UUID_SIZE) == 0
                         ? VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR
                         : VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

namespace
{

template <typename Info>
bool isAccepted(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command, const Info &info)
{
    return rules::takeCopy(device.objects.rules, command, info, input::Executor::Device, micromapFacts).accepted &&
           !InjectedWork::rejectedIn(device.commands, commandBuffer, command);
}

} // namespace

void cmdCopyMicromap(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const VkCopyMicromapInfoEXT *info)
{
    constexpr const char *kCommand = "vkCmdCopyMicromapEXT";
    if (isAccepted(device, commandBuffer, kCommand, *info))
        recordMicromapCopy(device, commandBuffer, kCommand, *micromapOf(info->src), *micromapOf(info->dst),
                           info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT);
}

void cmdCopyMicromapToMemory(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                             const VkCopyMicromapToMemoryInfoEXT *info)
{
    if (isAccepted(device, commandBuffer, "vkCmdCopyMicromapToMemoryEXT", *info))
        recordMicromapSave(device, commandBuffer, *micromapOf(info->src), info->dst.deviceAddress);
}

void cmdCopyMemoryToMicromap(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                             const VkCopyMemoryToMicromapInfoEXT *info)
{
    if (isAccepted(device, commandBuffer, "vkCmdCopyMemoryToMicromapEXT", *info))
        recordMicromapRestore(device, commandBuffer, *micromapOf(info->dst), info->src.deviceAddress);
}

} // namespace vellum::layer
