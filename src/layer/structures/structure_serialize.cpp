// Serialization of acceleration structures (core/records.h). The driver writes to memory of the layer's; what goes to
// the application's goes through shaders, which know where that ends.
#include <algorithm>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/ground/judge.h"
#include "layer/micromaps/micromap_serialized.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/objects/acceleration_structure.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/fitted_handle.h"
#include "layer/structures/serialized_data.h"
#include "layer/structures/structure_copy.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kUuidWords = 2 * VK_UUID_SIZE / 4;

Judge judgeOf(const DeviceStructures &device, const char *command, VkAccelerationStructureKHR structure)
{
    return {device.driver.report(), command, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
            reinterpret_cast<uint64_t>(structure)};
}

void saveTopLevel(InjectedWork &work, DeviceStructures &device, const AccelerationStructure &source,
                  VkDeviceAddress cell, VkDeviceAddress target)
{
    TopSavePush push{};
    push.cell = cell;
    push.begin = beginOf(device.driver, source);
    push.blob = target;
    push.root = device.objects.root.address();
    push.blank = blankStructure(device).address;
    push.structureUnits = unitsOf(source.size);
    push.leastUnits = unitsOf(topLevelTailOffset(device.driver, 0, 0));
    push.capacity = unitsOf(device.buffers.addresses.bytesFrom(target));
    for (push.pass = 0; push.pass < 2; ++push.pass) {
        work.dispatch(InjectedShader::TopSave, push, push.pass == 0 ? 1 : copyInvocations(source.size), 64);
        work.barrier();
    }
}

void saveBottomLevel(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer, CommandState &state,
                     const VkCopyAccelerationStructureToMemoryInfoKHR &info, const AccelerationStructure &source,
                     VkDeviceAddress cell)
{
    const VkAccelerationStructureKHR fitted = fittedHandle(device, info.src);
    const VkDeviceSize stagingBytes = (fitted == info.src ? source.size : lastBytes(source)) + kDriverOverhead;
    state.scratch.restart();
    const VkDeviceAddress staging = state.scratch.allocate(kPlanBytes + stagingBytes);
    if (!staging) {
        judgeOf(device, "vkCmdCopyAccelerationStructureToMemoryKHR", info.src)
            .refuse("VELLUM-out-of-memory", "no memory for the driver's serialized data");
        return;
    }
    VkCopyAccelerationStructureToMemoryInfoKHR driverInfo = info;
    driverInfo.src = fitted;
    driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    driverInfo.dst.deviceAddress = staging + kPlanBytes;
    device.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &driverInfo);
    work.barrier();
    const BlankFacts blank = blankStructure(device);
    StructureSavePush push{};
    push.cell = cell;
    push.begin = beginOf(device.driver, source);
    push.staging = staging;
    push.blob = info.dst.deviceAddress;
    push.root = device.objects.root.address();
    push.structureUnits = unitsOf(source.size);
    push.stagingUnits = unitsOf(stagingBytes);
    push.leastUnits = unitsOf(blank.structureBytes);
    push.capacity = unitsOf(device.buffers.addresses.bytesFrom(push.blob));
    push.wholeCopies = blank.wholeCopies;
    push.blocks = device.driver.asked.khr;
    for (push.pass = 0; push.pass < 2; ++push.pass) {
        work.dispatch(InjectedShader::StructureSave, push, push.pass == 0 ? 1 : copyInvocations(source.size), 64);
        work.barrier();
    }
}

} // namespace

void cmdCopyAccelerationStructureToMemory(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureToMemoryKHR";
    reportNotices(device.objects);
    if (InjectedWork::refusedIn(device.commands, commandBuffer, kCommand) ||
        savesMicromapStructure(device.micromaps, commandBuffer, *info))
        return;
    const auto source = device.objects.accelerationStructures.get(info->src);
    const auto state = device.commands.states.get(commandBuffer);
    const Judge judge = judgeOf(device, kCommand, info->src);
    if (!source || !state) {
        judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter",
                     "src is not an acceleration structure of this device");
        return;
    }
    if (info->mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412",
                        "mode is not VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR"))
        return;
    if (!judge.mayHoldSerialized(info->dst.deviceAddress, 256,
                                 "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739",
                                 "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740"))
        return;
    const VkAccelerationStructureTypeKHR content = contentOf(*source);
    const CellPlace cell = cellOf(device.objects, *source, info->src);
    if (content == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR || !cell.address || blankStructure(device).units == 0) {
        device.driver.report().notAvailable(
            "vkCmdCopyAccelerationStructureToMemoryKHR of a GENERIC structure recorded before "
            "any build of it, or without memory for the layer's tables,");
        return;
    }
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    if (content == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR)
        saveTopLevel(work, device, *source, cell.address, info->dst.deviceAddress);
    else
        saveBottomLevel(work, device, commandBuffer, *state, *info, *source, cell.address);
}

void getDeviceAccelerationStructureCompatibility(DeviceStructures &device, VkDevice handle,
                                                 const VkAccelerationStructureVersionInfoKHR *info,
                                                 VkAccelerationStructureCompatibilityKHR *compatibility)
{
    const SerializedMicromapHeader micromap = serializedHeader(device.driver.driverUuid, 0);
    if (std::memcmp(info->pVersionData, &micromap, 2 * VK_UUID_SIZE) == 0) {
        *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
        return;
    }
    // Whether the driver can read it is the driver's to say. Data of the driver alone is not compatible.
    uint32_t words[kUuidWords];
    std::memcpy(words, info->pVersionData, sizeof words);
    for (uint32_t w = VK_UUID_SIZE / 4; w < kUuidWords; ++w)
        words[w] ^= kCompatibilityWord;
    VkAccelerationStructureVersionInfoKHR driverInfo = *info;
    driverInfo.pVersionData = reinterpret_cast<const uint8_t *>(words);
    device.driver.next.GetDeviceAccelerationStructureCompatibilityKHR(handle, &driverInfo, compatibility);
    if (*compatibility != VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR)
        return;
    const BlankFacts blank = blankStructure(device);
    if (blank.units == 0 || std::memcmp(words, blank.words, sizeof words) != 0)
        *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

} // namespace vellum::layer
