// SPDX-License-Identifier: Apache-2.0
// Clones and compacted copies of acceleration structures with emulated micromaps.
//
// A copy of a bottom-level structure is the driver's, and a shader adds the records behind it. A copy of a top-level
// structure is a build from the instances that the source keeps, so that it has slots of its own: it stays as it is
// when the source is built again or destroyed. What was built into the source is read on the GPU, when the copy
// executes: commands may be recorded in any order.
#include <algorithm>
#include <string>
#include <utility>

#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/ids.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr const char *kCommand = "vkCmdCopyAccelerationStructureKHR";

// Limits on the number of instances that a copy is recorded for. A source without a recorded build may hold as many
// as its size allows. A source with recorded builds, if it is much larger than these need, holds at most kMostGrowth
// times as many, or kFewInstances. The size of a GENERIC structure states nothing: it holds what was recorded last.
constexpr uint32_t kMostGrowth = 4;
constexpr uint32_t kFewInstances = 4096;

uint32_t mostInstances(const DeviceStructures &device, const AccelerationStructure &source,
                       const AccelerationStructure &target)
{
    const bool generic = source.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ||
                         target.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    const uint32_t fits = topLevelCapacity(device.driver, std::min(source.size, target.size));
    const auto [most, last] = [&location = *source.location] {
        std::lock_guard lock(location.mutex);
        return std::pair(location.mostInstances, location.lastInstances);
    }();
    if (most == 0)
        return generic ? std::min(fits, topLevelCapacity(device.driver, capacityOf(device.objects, target))) : fits;
    if (generic)
        return std::min(fits, last);
    const uint64_t likely = std::max(uint64_t{most} * kMostGrowth, uint64_t{kFewInstances});
    return static_cast<uint32_t>(std::min<uint64_t>(fits, likely));
}

// A copy may be built for more instances than its source has.
void keepCount(const AccelerationStructure &source, AccelerationStructure &target)
{
    uint32_t instances;
    {
        std::lock_guard lock(source.location->mutex);
        instances = source.location->lastInstances;
    }
    std::lock_guard lock(target.location->mutex);
    if (instances > 0)
        target.location->lastInstances = std::min(target.location->lastInstances, instances);
}

void recordBottomLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                           const StructureCopy &copy, VkDeviceAddress sourceDescriptor,
                           VkDeviceAddress targetDescriptor)
{
    AccelerationStructure &source = *copy.source, &target = *copy.target;
    // Drivers that write whole handles do not compact.
    const VkDeviceSize bytes = copy.compact && !device.driver.clearsWholeHandles ? 0 : lastBytes(source);
    becomes(target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, bytes);
    StructureCopyPush push{};
    // If only the device knows the content, such a driver would copy the whole range of the handle.
    push.whole = bytes == 0 && (reachesOver(device, source) || reachesOver(device, target));
    if (!push.whole) {
        VkCopyAccelerationStructureInfoKHR info{VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR};
        info.mode = copy.compact ? VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR
                                 : VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
        info.src = exactSizeHandle(device, source);
        info.dst = bytes > 0 ? exactSizeHandle(device, target, bytes) : target.handle;
        device.driver.next.CmdCopyAccelerationStructureKHR(commandBuffer, &info);
        work.barrier();
    }
    push.sourceDescriptor = sourceDescriptor;
    push.targetDescriptor = targetDescriptor;
    push.sourceBegin = beginOf(device.driver, source);
    push.targetBegin = beginOf(device.driver, target);
    push.root = device.objects.root.address();
    push.sourceUnits = unitsOf(source.size);
    push.targetUnits = unitsOf(target.size);
    push.compact = copy.compact;
    work.dispatch(InjectedShader::StructureCopy, push, copyInvocations(source.size), 64);
    work.barrier(true); // the host reads the counters of errors
}

} // namespace

bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, AccelerationStructure &target, VkDeviceAddress source,
                        const TopLevelLayout &layout, uint32_t from)
{
    if (layout.bytes() > target.size)
        return rejectCommand(device.driver, command, target.handle,
                             from == kFromStructure ? rules::ids::kCompactedSize : rules::ids::kDeserializedSize,
                             "dst is too small for any top-level structure");
    const auto slots = slotsFor(device.objects, target, layout.count);
    const auto state = device.commands.states.get(commandBuffer);
    const VkDeviceAddress scratch = state ? state->scratch.allocate(alignUp(layout.scratchBytes, kPartAlignment)) : 0;
    const VkAccelerationStructureKHR exact = exactSizeHandleOrNull(device, target, layout.tailOffset);
    if (!slots || !scratch || !exact)
        return rejectCommand(device.driver, command, target.handle, "VELLUM-out-of-memory",
                             "no slots, no scratch memory or no handle of the driver for the copy");
    device.commands.states.keep(commandBuffer, slots->use());
    becomesTopLevel(target, layout.count, layout.tailOffset);
    TlasGatherPush push{};
    push.source = source;
    push.root = device.objects.root.address();
    push.tail = beginOf(device.driver, target) + layout.tailOffset;
    push.descriptor = descriptorOf(device.objects, target).address;
    push.count = layout.count;
    push.firstSlot = slots->first();
    push.from = from;
    if (!work.dispatch(InjectedShader::TlasGather, push, std::max(layout.count, 1u), 64))
        return false;
    work.barrier();
    if (!patchInstances(work, device, *slots, layout.count, push.tail, push.tail, InstanceSource::Copy))
        return false;
    work.barrier(true); // the host reads the descriptor and the counters of errors
    TopLevelBuild build(kTopLevelCopyFlags, push.tail);
    build.info.dstAccelerationStructure = exact;
    build.info.scratchData.deviceAddress = scratch;
    const VkAccelerationStructureBuildRangeInfoKHR range{layout.count, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    device.driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer, 1, &build.info, &ranges);
    work.barrier();
    return true;
}

uint64_t copyInvocations(VkDeviceSize bytes)
{
    constexpr VkDeviceSize kBytesPerInvocation = 256;
    return std::clamp<uint64_t>(bytes / kBytesPerInvocation, 64, 16384);
}

VkDeviceSize EmulatedBackend::cloneBytes(const StructureCopy &copy)
{
    // Only the device knows how many bytes of a micromap are in use.
    if (copy.isMicromap())
        return 0;
    // With VK_KHR_ray_tracing_maintenance1 the size is the one that a query reports; the size of a GENERIC structure's
    // handle states nothing.
    const bool unknown =
        device_.driver.queriesStructureSize || copy.source->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    // Only the device knows how many instances a top level has that was deserialized or built indirectly.
    if (unknown && copy.type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR)
        return 0;
    return unknown ? std::min(copy.source->size, lastBytes(*copy.source)) : copy.source->size;
}

void EmulatedBackend::record(VkCommandBuffer commandBuffer, const StructureCopy &copy)
{
    AccelerationStructure &source = *copy.source, &target = *copy.target;
    if (copy.isMicromap()) {
        becomeMicromap(device_.objects, target);
        return recordMicromapCopy(device_.micromaps, commandBuffer, kCommand, micromapIn(source), micromapIn(target),
                                  copy.compact);
    }
    const StructureDescriptor sourceDescriptor = descriptorOf(device_.objects, source);
    const StructureDescriptor targetDescriptor = descriptorOf(device_.objects, target);
    if (!sourceDescriptor.address || !targetDescriptor.address) {
        rejectCommand(device_.driver, kCommand, target.handle, "VELLUM-out-of-memory",
                      "no memory for the layer's tables");
        return;
    }
    if (const auto state = device_.commands.states.get(commandBuffer))
        state->scratch.restart();
    InjectedWork work(device_.commands, commandBuffer);
    const bool top = copy.type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    if (!(top ? work.prepare(InjectedShader::TlasGather) && work.prepare(InjectedShader::TlasInstances)
              : work.prepare(InjectedShader::StructureCopy)))
        return;
    work.barrier();
    if (top) {
        const TopLevelLayout layout(device_.driver, kTopLevelCopyFlags, mostInstances(device_, source, target));
        recordTopLevelCopy(work, device_, commandBuffer, kCommand, target, sourceDescriptor.address, layout,
                           kFromStructure);
        keepCount(source, target);
    } else {
        recordBottomLevelCopy(work, device_, commandBuffer, copy, sourceDescriptor.address, targetDescriptor.address);
    }
}

} // namespace vellum::layer
