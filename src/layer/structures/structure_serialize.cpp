// Serialized acceleration structures (core/records.h). The driver writes to and reads from memory of the layer's; what
// goes to or comes from the application's memory goes through shaders, which know where it ends and believe nothing.
#include <algorithm>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/micromaps/micromap_serialized.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/objects/acceleration_structure.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/fitted_handle.h"
#include "layer/structures/structure_copy.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr VkDeviceSize kPlanBytes = 256;        // before the driver's data: shaders/serialized.glsl
constexpr VkDeviceSize kDriverOverhead = 65536; // of serialized data over the structure; 56 bytes on known drivers
constexpr uint32_t kUuidWords = 2 * VK_UUID_SIZE / 4;

void refuse(const DeviceStructures &device, const char *id, const char *command, const std::string &text,
            VkAccelerationStructureKHR structure)
{
    device.driver.report().error(id, std::string(command) + ": " + text, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                                 reinterpret_cast<uint64_t>(structure));
}

void saveTopLevel(InjectedWork &work, DeviceStructures &device, const AccelerationStructure &source,
                  VkDeviceAddress cell, VkDeviceAddress target)
{
    TopSavePush push{};
    push.cell = cell;
    push.begin = beginOf(device.driver, source);
    push.blob = target;
    push.root = device.objects.root.address();
    push.blank = blankStructure(device).memory.address();
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
    const VkDeviceAddress staging = state.scratch.allocate(device.buffers.gpu, kPlanBytes + stagingBytes);
    if (!staging) {
        refuse(device, "VELLUM-out-of-memory", "vkCmdCopyAccelerationStructureToMemoryKHR",
               "no memory for the driver's serialized data", info.src);
        return;
    }
    VkCopyAccelerationStructureToMemoryInfoKHR driverInfo = info;
    driverInfo.src = fitted;
    driverInfo.dst.deviceAddress = staging + kPlanBytes;
    device.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &driverInfo);
    work.barrier();
    const BlankStructure &blank = blankStructure(device);
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

// Checks the data and, of a bottom-level structure, brings the driver's part to staging memory.
void checkSerialized(InjectedWork &work, StructureRestorePush &push, VkDeviceSize bytes)
{
    const uint32_t passes = push.kind == kCellBottom ? 4 : 3;
    for (push.pass = 0; push.pass < passes; ++push.pass) {
        const bool one = push.pass == 0 || push.pass == 2;
        work.dispatch(InjectedShader::StructureRestore, push, one ? 1 : copyInvocations(bytes), 64);
        work.barrier();
    }
}

struct Restore {
    DeviceStructures &device;
    VkCommandBuffer commandBuffer;
    const VkCopyMemoryToAccelerationStructureInfoKHR &info;
    std::shared_ptr<AccelerationStructure> target;
    std::shared_ptr<CommandState> state;

    [[nodiscard]] VkDeviceSize readable() const { return device.buffers.addresses.bytesFrom(info.src.deviceAddress); }

    [[nodiscard]] bool topLevel() const
    {
        if (target->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
            return target->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
        return target->size % 256 == kTopLevelSizeMark;
    }

    void refused(const char *id, const char *text) const
    {
        refuse(device, id, "vkCmdCopyMemoryToAccelerationStructureKHR", text, info.dst);
    }

    [[nodiscard]] bool valid() const
    {
        if (!target)
            refused("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter",
                    "dst is not an acceleration structure of this device");
        else if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR)
            refused("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413",
                    "mode is not VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR");
        else if (info.src.deviceAddress == 0)
            refused("VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742", "src is a null address");
        else if (info.src.deviceAddress % 256 != 0)
            refused("VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03743",
                    "src is not aligned to 256 bytes");
        else if (blankStructure(device).units == 0)
            device.driver.report().notAvailable(
                "vkCmdCopyMemoryToAccelerationStructureKHR, since the driver's serialized "
                "data could not be looked at,");
        else if (!topLevel() && target->size < blankStructure(device).structureBytes)
            // Not even what stands in for data that is refused has room.
            refused("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746",
                    "dst is smaller than any deserialized structure");
        else
            return true;
        return false;
    }

    void record() const
    {
        const BlankStructure &blank = blankStructure(device);
        const bool top = topLevel();
        const CellPlace cell = cellOf(device.objects, *target, info.dst);
        const VkDeviceSize stagingBytes =
            top ? 0 : std::max(VkDeviceSize{blank.units} * 16, std::min(readable(), target->size + kDriverOverhead));
        if (state)
            state->scratch.restart();
        const VkDeviceAddress staging =
            state && cell.address ? state->scratch.allocate(device.buffers.gpu, kPlanBytes + stagingBytes) : 0;
        if (!staging) {
            refused("VELLUM-out-of-memory", "no memory for the serialized data");
            return;
        }
        StructureRestorePush push{};
        push.blob = info.src.deviceAddress;
        push.staging = staging;
        push.cell = cell.address;
        push.begin = beginOf(device.driver, *target);
        push.root = device.objects.root.address();
        push.blank = blank.memory.address();
        push.blankUnits = blank.units;
        push.capacity = unitsOf(readable());
        push.stagingUnits = unitsOf(stagingBytes);
        push.targetUnits = unitsOf(target->size);
        push.kind = top ? kCellTop : kCellBottom;
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        checkSerialized(work, push, target->size);
        if (top)
            restoreTopLevel(work, staging);
        else
            restoreBottomLevel(work, push);
    }

    void restoreTopLevel(InjectedWork &work, VkDeviceAddress staging) const
    {
        constexpr VkDeviceSize kLeast = sizeof(VkAccelerationStructureInstanceKHR) + sizeof(VkDeviceAddress);
        const VkDeviceSize inMemory = std::min<VkDeviceSize>(readable() / kLeast, UINT32_MAX);
        const uint32_t most = std::min(topLevelCapacity(device.driver, target->size), static_cast<uint32_t>(inMemory));
        recordTopLevelCopy(work, device, commandBuffer, "vkCmdCopyMemoryToAccelerationStructureKHR", info.dst,
                           staging + VkDeviceSize{kPlanCellWord} * 4, most, InstancesFrom::Serialized);
    }

    void restoreBottomLevel(InjectedWork &work, StructureRestorePush &push) const
    {
        becomes(*target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, 0);
        VkCopyMemoryToAccelerationStructureInfoKHR driverInfo = info;
        driverInfo.src.deviceAddress = push.staging + kPlanBytes;
        device.driver.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, &driverInfo);
        work.barrier();
        push.pass = kFinishPass;
        work.dispatch(InjectedShader::StructureRestore, push, copyInvocations(target->size), 64);
        work.barrier();
    }

    static constexpr uint32_t kPlanCellWord = 8; // shaders/serialized.glsl
    static constexpr uint32_t kFinishPass = 4;   // shaders/structure_restore.comp
};

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
    if (!source || !state) {
        refuse(device, "VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter", kCommand,
               "src is not an acceleration structure of this device", info->src);
        return;
    }
    if (info->mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR) {
        refuse(device, "VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", kCommand,
               "mode is not VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR", info->src);
        return;
    }
    if (info->dst.deviceAddress == 0 || info->dst.deviceAddress % 256 != 0) {
        refuse(device,
               info->dst.deviceAddress == 0 ? "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739"
                                            : "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740",
               kCommand, "dst is a null address or not aligned to 256 bytes", info->src);
        return;
    }
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

void cmdCopyMemoryToAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    reportNotices(device.objects);
    if (InjectedWork::refusedIn(device.commands, commandBuffer, "vkCmdCopyMemoryToAccelerationStructureKHR") ||
        restoresMicromapStructure(device.micromaps, commandBuffer, *info))
        return;
    const Restore restore{device, commandBuffer, *info, device.objects.accelerationStructures.get(info->dst),
                          device.commands.states.get(commandBuffer)};
    if (restore.valid())
        restore.record();
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
    const BlankStructure &blank = blankStructure(device);
    if (blank.units == 0 || std::memcmp(words, blank.memory.words(), sizeof words) != 0)
        *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

} // namespace vellum::layer
