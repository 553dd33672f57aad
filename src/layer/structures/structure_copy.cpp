#include "layer/structures/structure_copy.h"

#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/door/device.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/structures/acceleration_structure.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// What a source without any recorded build may hold can only be told from its size; one of which more is known, and
// that is much larger than its instances need, holds at most so many times the instances that were recorded.
constexpr uint32_t kMostGrowth = 4;
constexpr uint32_t kFewInstances = 4096;

struct Copy {
    Device &device;
    VkCommandBuffer commandBuffer;
    const VkCopyAccelerationStructureInfoKHR &info;
    std::shared_ptr<AccelerationStructure> source, target;

    void refuse(const char *id, const std::string &text) const
    {
        device.report().error(id, "vkCmdCopyAccelerationStructureKHR: " + text,
                              VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(info.dst));
    }

    [[nodiscard]] bool valid() const
    {
        if (!source)
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-src-parameter",
                   "src is not an acceleration structure of this device");
        else if (!target)
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter",
                   "dst is not an acceleration structure of this device");
        else if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR &&
                 info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR)
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410",
                   "mode " + std::to_string(info.mode) + " is neither clone nor compact");
        else if (device.structureAddress(info.src) == device.structureAddress(info.dst))
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", "src and dst are the same memory");
        else if (info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR && target->size < source->size &&
                 !device.queriesStructureSize)
            // With VK_KHR_ray_tracing_maintenance1 the size to compare with is one that a query has told.
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12418",
                   "dst has " + std::to_string(target->size) + " bytes, src " + std::to_string(source->size));
        else
            return true;
        return false;
    }

    // Top or bottom level; GENERIC: nothing tells.
    [[nodiscard]] VkAccelerationStructureTypeKHR type() const
    {
        std::lock_guard lock(source->mutex);
        if (source->content != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
            return source->content;
        return target->type;
    }

    [[nodiscard]] uint32_t mostInstances() const
    {
        const uint32_t fits = std::min(topLevelCapacity(device, source->size), topLevelCapacity(device, target->size));
        std::lock_guard lock(source->mutex);
        if (source->mostInstances == 0)
            return fits;
        const uint64_t likely = std::max(uint64_t{source->mostInstances} * kMostGrowth, uint64_t{kFewInstances});
        return static_cast<uint32_t>(std::min<uint64_t>(fits, likely));
    }

    void record() const
    {
        const VkAccelerationStructureTypeKHR level = type();
        if (level == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR) {
            device.report().notAvailable("vkCmdCopyAccelerationStructureKHR between two structures of type GENERIC, "
                                         "recorded before any build of the source,");
            return;
        }
        if (target->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR && target->type != level) {
            refuse("VELLUM-copy-type", "dst was created with another type than src");
            return;
        }
        const CellPlace sourceCell = cellOf(device, *source, info.src);
        const CellPlace targetCell = cellOf(device, *target, info.dst);
        if (!sourceCell.address || !targetCell.address) {
            refuse("VELLUM-out-of-memory", "no memory for the layer's tables");
            return;
        }
        if (const auto state = commandState(commandBuffer))
            state->scratch.restart();
        InjectedWork work(device, commandBuffer);
        work.barrier();
        if (level == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR) {
            recordTopLevelCopy(work, device, commandBuffer, "vkCmdCopyAccelerationStructureKHR", info.dst,
                               sourceCell.address, mostInstances(), InstancesFrom::Structure);
            return;
        }
        {
            std::lock_guard lock(target->mutex);
            target->content = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        }
        device.next.CmdCopyAccelerationStructureKHR(commandBuffer, &info);
        work.barrier();
        StructureCopyPush push{};
        push.sourceCell = sourceCell.address;
        push.targetCell = targetCell.address;
        push.sourceBegin = beginOf(device, *source);
        push.targetBegin = beginOf(device, *target);
        push.root = device.root.address();
        push.sourceUnits = unitsOf(source->size);
        push.targetUnits = unitsOf(target->size);
        push.compact = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
        work.dispatch(InjectedShader::StructureCopy, push, copyInvocations(source->size), 64);
        work.barrier();
    }
};

} // namespace

uint64_t copyInvocations(VkDeviceSize bytes)
{
    constexpr VkDeviceSize kBytesPerInvocation = 256;
    return std::clamp<uint64_t>(bytes / kBytesPerInvocation, 64, 16384);
}

bool recordTopLevelCopy(InjectedWork &work, Device &device, VkCommandBuffer commandBuffer, const char *command,
                        VkAccelerationStructureKHR target, VkDeviceAddress source, uint32_t most, InstancesFrom from)
{
    const auto refuse = [&](const char *id, const char *text) {
        device.report().error(id, std::string(command) + ": " + text, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                              reinterpret_cast<uint64_t>(target));
        return false;
    };
    const auto structure = device.accelerationStructures.get(target);
    if (topLevelBytes(device, 0, most) > structure->size)
        return refuse(from == InstancesFrom::Structure
                          ? "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12419"
                          : "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746",
                      "dst is too small for any top-level structure");
    const auto slots = slotsFor(device, *structure, most);
    const auto state = commandState(commandBuffer);
    const VkDeviceSize scratchBytes = alignUp(topLevelDriverSizes(device, 0, most).buildScratchSize, kPartAlignment);
    const VkDeviceAddress scratch =
        state ? state->scratch.allocate(device.gpu, scratchBytes + patchedInstancesBytes(most)) : 0;
    if (!slots || !scratch)
        return refuse("VELLUM-out-of-memory", "no slots or no scratch memory for the copy");
    {
        std::lock_guard lock(structure->mutex);
        structure->content = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
        structure->mostInstances = std::max(structure->mostInstances, most);
    }
    TlasInstancesPush push{};
    push.source = source;
    push.target = scratch + scratchBytes;
    push.root = device.root.address();
    push.tail = beginOf(device, *structure) + topLevelTailOffset(device, 0, most);
    push.cell = cellOf(device, *structure, target).address;
    push.count = most;
    push.firstSlot = slots->first();
    push.from = from;
    if (!work.dispatch(InjectedShader::TlasInstances, push, std::max(most, 1u), 64))
        return false;
    work.barrier();
    TopLevelBuild build(0, push.target);
    build.info.dstAccelerationStructure = target;
    build.info.scratchData.deviceAddress = scratch;
    const VkAccelerationStructureBuildRangeInfoKHR range{most, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    device.next.CmdBuildAccelerationStructuresKHR(commandBuffer, 1, &build.info, &ranges);
    work.barrier();
    push.pass = 1;
    work.dispatch(InjectedShader::TlasInstances, push, std::max(most, 1u), 64);
    work.barrier();
    return true;
}

VKAPI_ATTR void VKAPI_CALL cmdCopyAccelerationStructure(VkCommandBuffer commandBuffer,
                                                        const VkCopyAccelerationStructureInfoKHR *info)
{
    Device &device = deviceOf(commandBuffer);
    reportNotices(device);
    if (InjectedWork::refusedIn(device, commandBuffer, "vkCmdCopyAccelerationStructureKHR"))
        return;
    if (copiesMicromapStructure(device, commandBuffer, *info))
        return;
    const Copy copy{device, commandBuffer, *info, device.accelerationStructures.get(info->src),
                    device.accelerationStructures.get(info->dst)};
    if (copy.valid())
        copy.record();
}

VKAPI_ATTR VkResult VKAPI_CALL copyAccelerationStructure(VkDevice handle, VkDeferredOperationKHR,
                                                         const VkCopyAccelerationStructureInfoKHR *)
{
    deviceOf(handle).report().notAvailable("vkCopyAccelerationStructureKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyAccelerationStructureToMemory(VkDevice handle, VkDeferredOperationKHR,
                                                                 const VkCopyAccelerationStructureToMemoryInfoKHR *)
{
    deviceOf(handle).report().notAvailable("vkCopyAccelerationStructureToMemoryKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMemoryToAccelerationStructure(VkDevice handle, VkDeferredOperationKHR,
                                                                 const VkCopyMemoryToAccelerationStructureInfoKHR *)
{
    deviceOf(handle).report().notAvailable("vkCopyMemoryToAccelerationStructureKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace vellum::layer
