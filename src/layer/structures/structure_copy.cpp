#include "layer/structures/structure_copy.h"

#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/ground/judge.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/objects/acceleration_structure.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/fitted_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// What a source without any recorded build may hold can only be told from its size; one of which more is known, and
// that is much larger than its instances need, holds at most so many times the instances that were recorded. Of GENERIC
// structures the size says nothing: they hold what was recorded last, and so many instances.
constexpr uint32_t kMostGrowth = 4;
constexpr uint32_t kFewInstances = 4096;

struct Copy {
    DeviceStructures &device;
    VkCommandBuffer commandBuffer;
    const VkCopyAccelerationStructureInfoKHR &info;
    std::shared_ptr<AccelerationStructure> source, target;

    [[nodiscard]] Judge judge() const
    {
        return {device.driver.report(), "vkCmdCopyAccelerationStructureKHR", VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                reinterpret_cast<uint64_t>(info.dst)};
    }
    void refuse(const char *id, const std::string &text) const { judge().refuse(id, text); }
    // What is neither to be compacted nor cloned is cloned, as drivers do it.
    [[nodiscard]] bool compacts() const { return info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR; }

    // What a clone needs, as far as the host knows. With VK_KHR_ray_tracing_maintenance1 that is what a query has told,
    // and of a GENERIC structure the size of the handle says nothing.
    [[nodiscard]] VkDeviceSize cloneBytes() const
    {
        const bool unknown =
            device.driver.queriesStructureSize || source->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
        return std::min(source->size, unknown ? lastBytes(*source) : source->size);
    }

    [[nodiscard]] bool valid() const
    {
        if (!source)
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-src-parameter",
                   "src is not an acceleration structure of this device");
        else if (!target)
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter",
                   "dst is not an acceleration structure of this device");
        else if (source->place == target->place ||
                 device.driver.structureAddress(info.src) == device.driver.structureAddress(info.dst))
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", "src and dst are the same memory");
        else if (!compacts() && target->size < cloneBytes())
            refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12418",
                   "dst has " + std::to_string(target->size) + " bytes, src " + std::to_string(cloneBytes()));
        else
            return compacts() || info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR ||
                   judge().tolerate("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410",
                                    "mode " + std::to_string(info.mode) + " is neither clone nor compact");
        return false;
    }

    // Top or bottom level; GENERIC: nothing tells.
    [[nodiscard]] VkAccelerationStructureTypeKHR type() const
    {
        const VkAccelerationStructureTypeKHR content = contentOf(*source);
        return content != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ? content : target->type;
    }

    [[nodiscard]] uint32_t mostInstances() const
    {
        const uint32_t fits =
            std::min(topLevelCapacity(device.driver, source->size), topLevelCapacity(device.driver, target->size));
        std::lock_guard lock(source->place->mutex);
        const StructurePlace &place = *source->place;
        const bool generic = source->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ||
                             target->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
        if (place.mostInstances == 0)
            return generic ? std::min(fits, topLevelCapacity(device.driver, roomOf(device.objects, *target))) : fits;
        if (generic)
            return std::min(fits, place.lastInstances);
        const uint64_t likely = std::max(uint64_t{place.mostInstances} * kMostGrowth, uint64_t{kFewInstances});
        return static_cast<uint32_t>(std::min<uint64_t>(fits, likely));
    }

    // A copy may be built for more instances than there are.
    void keepCount() const
    {
        uint32_t instances;
        {
            std::lock_guard lock(source->place->mutex);
            instances = source->place->lastInstances;
        }
        std::lock_guard lock(target->place->mutex);
        if (instances > 0)
            target->place->lastInstances = std::min(target->place->lastInstances, instances);
    }

    void record() const
    {
        const VkAccelerationStructureTypeKHR level = type();
        if (level == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR) {
            device.driver.report().notAvailable(
                "vkCmdCopyAccelerationStructureKHR between two structures of type GENERIC, "
                "recorded before any build of the source,");
            return;
        }
        if (target->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR && target->type != level) {
            refuse("VELLUM-copy-type", "dst was created with another type than src");
            return;
        }
        const CellPlace sourceCell = cellOf(device.objects, *source, info.src);
        const CellPlace targetCell = cellOf(device.objects, *target, info.dst);
        if (!sourceCell.address || !targetCell.address) {
            refuse("VELLUM-out-of-memory", "no memory for the layer's tables");
            return;
        }
        if (const auto state = device.commands.states.get(commandBuffer))
            state->scratch.restart();
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        if (level == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR) {
            recordTopLevelCopy(work, device, commandBuffer, "vkCmdCopyAccelerationStructureKHR", info.dst,
                               sourceCell.address, mostInstances(), InstancesFrom::Structure);
            keepCount();
            return;
        }
        // Drivers that write whole handles do not compact.
        const VkDeviceSize bytes = compacts() && !device.driver.clearsWholeHandles ? 0 : lastBytes(*source);
        becomes(*target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, bytes);
        StructureCopyPush push{};
        // Of a content that only the device knows, such a driver would copy all that the handle reaches over.
        push.whole = bytes == 0 && (reachesOver(device, *source) || reachesOver(device, *target));
        if (!push.whole) {
            VkCopyAccelerationStructureInfoKHR driverInfo = info;
            if (!compacts())
                driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
            driverInfo.src = fittedHandle(device, info.src);
            driverInfo.dst = bytes > 0 ? fittedHandle(device, *target, info.dst, bytes) : info.dst;
            device.driver.next.CmdCopyAccelerationStructureKHR(commandBuffer, &driverInfo);
            work.barrier();
        }
        push.sourceCell = sourceCell.address;
        push.targetCell = targetCell.address;
        push.sourceBegin = beginOf(device.driver, *source);
        push.targetBegin = beginOf(device.driver, *target);
        push.root = device.objects.root.address();
        push.sourceUnits = unitsOf(source->size);
        push.targetUnits = unitsOf(target->size);
        push.compact = compacts();
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

bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, VkAccelerationStructureKHR target, VkDeviceAddress source, uint32_t most,
                        InstancesFrom from)
{
    const auto refuse = [&](const char *id, const char *text) {
        device.driver.report().error(id, std::string(command) + ": " + text, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                                     reinterpret_cast<uint64_t>(target));
        return false;
    };
    const auto structure = device.objects.accelerationStructures.get(target);
    if (topLevelBytes(device.driver, 0, most) > structure->size)
        return refuse(from == InstancesFrom::Structure
                          ? "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12419"
                          : "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746",
                      "dst is too small for any top-level structure");
    const auto slots = slotsFor(device.objects, *structure, most);
    const auto state = device.commands.states.get(commandBuffer);
    const VkDeviceSize scratchBytes =
        alignUp(topLevelDriverSizes(device.driver, 0, most).buildScratchSize, kPartAlignment);
    const VkDeviceAddress scratch = state ? state->scratch.allocate(scratchBytes + patchedInstancesBytes(most)) : 0;
    if (!slots || !scratch)
        return refuse("VELLUM-out-of-memory", "no slots or no scratch memory for the copy");
    const VkDeviceSize bytes = topLevelBytes(device.driver, 0, most);
    becomesTopLevel(*structure, most, bytes);
    TlasInstancesPush push{};
    push.source = source;
    push.target = scratch + scratchBytes;
    push.root = device.objects.root.address();
    push.tail = beginOf(device.driver, *structure) + topLevelTailOffset(device.driver, 0, most);
    push.cell = cellOf(device.objects, *structure, target).address;
    push.count = most;
    push.firstSlot = slots->first();
    push.from = from;
    if (!work.dispatch(InjectedShader::TlasInstances, push, std::max(most, 1u), 64))
        return false;
    work.barrier();
    TopLevelBuild build(0, push.target);
    build.info.dstAccelerationStructure = fittedHandle(device, *structure, target, bytes);
    build.info.scratchData.deviceAddress = scratch;
    const VkAccelerationStructureBuildRangeInfoKHR range{most, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    device.driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer, 1, &build.info, &ranges);
    work.barrier();
    push.pass = 1;
    work.dispatch(InjectedShader::TlasInstances, push, std::max(most, 1u), 64);
    work.barrier();
    return true;
}

void cmdCopyAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    reportNotices(device.objects);
    if (InjectedWork::refusedIn(device.commands, commandBuffer, "vkCmdCopyAccelerationStructureKHR"))
        return;
    if (copiesMicromapStructure(device.micromaps, commandBuffer, *info))
        return;
    const Copy copy{device, commandBuffer, *info, device.objects.accelerationStructures.get(info->src),
                    device.objects.accelerationStructures.get(info->dst)};
    if (copy.valid())
        copy.record();
}

VkResult copyAccelerationStructure(DeviceStructures &device, VkDevice, VkDeferredOperationKHR,
                                   const VkCopyAccelerationStructureInfoKHR *)
{
    device.driver.report().notAvailable("vkCopyAccelerationStructureKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VkResult copyAccelerationStructureToMemory(DeviceStructures &device, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyAccelerationStructureToMemoryInfoKHR *)
{
    device.driver.report().notAvailable("vkCopyAccelerationStructureToMemoryKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VkResult copyMemoryToAccelerationStructure(DeviceStructures &device, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *)
{
    device.driver.report().notAvailable("vkCopyMemoryToAccelerationStructureKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace vellum::layer
