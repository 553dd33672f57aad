#include "layer/acceleration_structure.h"

#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/device.h"
#include "layer/driver_build_info.h"
#include "layer/micromap.h"

namespace vellum::layer
{
namespace
{

using namespace shared;
using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

constexpr VkDeviceSize alignUp(VkDeviceSize value, VkDeviceSize alignment)
{
    return (value + alignment - 1) / alignment * alignment;
}

constexpr VkDeviceSize kAlignment = 256; // of parts within acceleration structures and scratch memory
constexpr VkDeviceSize kGeometryRecordBytes = kGeometryRecordWords * 4;
constexpr VkDeviceSize kTriangleRecordBytes = kTriangleRecordWords * 4;

// Bytes of the records of a bottom-level structure, which lie at the end of its memory. `primitives(i)`: of geometry i.
template <typename Primitives>
VkDeviceSize tailBytes(const DriverBuildInfo &build, Primitives primitives)
{
    if (!build.hasMicromaps())
        return 0;
    VkDeviceSize bytes = build.geometryCount() * kGeometryRecordBytes;
    for (uint32_t i = 0; i < build.geometryCount(); ++i) {
        if (build.micromap(i))
            bytes += alignUp(primitives(i) * kTriangleRecordBytes, 16);
    }
    return alignUp(bytes, kAlignment);
}

VkDeviceSize patchedInstancesBytes(uint32_t count)
{
    return kAlignment + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
}

// A structure that is copied and built again in turn would collect ranges without end. Work that was recorded so many
// builds ago is taken to be done.
constexpr size_t kMostOutgrown = 32;

void retireSlots(AccelerationStructure &structure)
{
    if (!structure.slots)
        return;
    structure.outgrownSlots.push_back(std::move(structure.slots));
    if (structure.outgrownSlots.size() > kMostOutgrown)
        structure.outgrownSlots.erase(structure.outgrownSlots.begin());
}

// The slots that a build of `count` instances into this structure uses: those it has, unless they are too few or a copy
// of the structure shares them. Work recorded before may still write or read the old ones, so they stay with the
// structure; growing by half keeps them few.
std::shared_ptr<SlotRange> slotsFor(Device &device, AccelerationStructure &structure, uint32_t count)
{
    std::lock_guard lock(structure.mutex);
    const uint32_t had = structure.slots ? structure.slots->count() : 0;
    if (structure.slots && had >= count && structure.slots.use_count() == 1)
        return structure.slots;
    auto slots = device.root.allocateSlots(count > had ? std::max(count, had + had / 2) : count);
    if (!slots)
        slots = device.root.allocateSlots(count);
    if (!slots)
        return nullptr;
    retireSlots(structure);
    structure.slots = slots;
    return slots;
}

// Makes the structure a user of its reference's cell. A structure that never had micromaps needs that too, once another
// one of the same reference has: its builds must clear the cell, and the cell must not be another's by then.
VkDeviceAddress acquireCell(Device &device, AccelerationStructure &structure, VkDeviceAddress reference)
{
    std::lock_guard lock(structure.mutex);
    if (!structure.cell) {
        structure.cell = device.root.acquireCell(reference);
        structure.reference = reference;
    }
    return structure.cell;
}

// After a copy over it, a structure has no micromaps: those of an earlier build must not be found any more.
void forgetMicromaps(Device &device, VkCommandBuffer commandBuffer, VkAccelerationStructureKHR handle)
{
    const auto structure = device.accelerationStructures.get(handle);
    const VkDeviceAddress reference = device.structureAddress(handle);
    if (!structure || !device.root.findCell(reference))
        return;
    BlasRecordsPush push{};
    push.cell = acquireCell(device, *structure, reference);
    structure->hasMicromaps = false;
    structure->recordsBytes = 0;
    InjectedWork work(device, commandBuffer);
    work.barrier();
    work.dispatch(InjectedShader::BlasRecords, push, 1, 64);
    work.barrier();
}

// One vkCmdBuildAccelerationStructuresKHR: the patched copies, and the work around the driver's build.
class Build
{
public:
    Build(Device &device, VkCommandBuffer commandBuffer, uint32_t count, const BuildInfo *infos,
          const RangeInfo *const *ranges)
        : device_(device), commandBuffer_(commandBuffer), infos_(infos), ranges_(ranges)
    {
        parts_.reserve(count);
        for (uint32_t i = 0; i < count; ++i)
            parts_.push_back(Part{DriverBuildInfo(infos[i]), nullptr, 0, 0, {}, false});
    }

    void record()
    {
        if (InjectedWork::refusedIn(device_, commandBuffer_, "vkCmdBuildAccelerationStructuresKHR"))
            return;
        for (uint32_t i = 0; i < parts_.size(); ++i)
            prepare(i);
        InjectedWork work(device_, commandBuffer_);
        patchInstances(work);
        runDriver();
        writeRecords(work);
    }

private:
    struct Part {
        DriverBuildInfo build;
        std::shared_ptr<AccelerationStructure> target;
        VkDeviceAddress tail = 0; // where the records go; 0: there are none
        VkDeviceAddress cell = 0; // to be written with them
        RangeInfo instanceRange;  // of the patched instances
        bool skipped = false;
    };

    void refuse(Part &part, uint32_t i, const char *id, const std::string &text)
    {
        device_.report().error(id, "vkCmdBuildAccelerationStructuresKHR: pInfos[" + std::to_string(i) + "]: " + text,
                               VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                               reinterpret_cast<uint64_t>(infos_[i].dstAccelerationStructure));
        part.skipped = true;
    }

    void prepare(uint32_t i)
    {
        Part &part = parts_[i];
        part.target = device_.accelerationStructures.get(infos_[i].dstAccelerationStructure);
        if (!part.target) {
            refuse(part, i,
                   "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-dstAccelerationStructure-parameter",
                   "dstAccelerationStructure is not an acceleration structure of this device");
            return;
        }
        if (!part.build.topLevel())
            prepareBottomLevel(part, i);
    }

    void prepareBottomLevel(Part &part, uint32_t i)
    {
        AccelerationStructure &target = *part.target;
        const VkDeviceAddress reference = device_.structureAddress(infos_[i].dstAccelerationStructure);
        if (!part.build.hasMicromaps()) {
            // A structure of the same address had micromaps once: the TLAS must no longer find them.
            if (device_.root.findCell(reference))
                part.cell = acquireCell(device_, target, reference);
            target.hasMicromaps = false;
            target.recordsBytes = 0;
            return;
        }
        const VkDeviceSize bytes =
            tailBytes(part.build, [&](uint32_t g) { return VkDeviceSize{ranges_[i][g].primitiveCount}; });
        if (bytes > target.size) {
            refuse(part, i, "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                   "dstAccelerationStructure has " + std::to_string(target.size) +
                       " bytes, less than vkGetAccelerationStructureBuildSizesKHR gives");
            return;
        }
        target.hasMicromaps = true;
        target.recordsBytes = bytes;
        part.cell = acquireCell(device_, target, reference);
        if (!part.cell) {
            refuse(part, i, "VELLUM-out-of-memory", "no memory for the layer's tables");
            return;
        }
        const VkDeviceAddress begin = device_.bufferAddress(target.buffer) + target.offset;
        part.tail = (begin + target.size - bytes) & ~VkDeviceAddress{15};
    }

    // Where the patched instances go: behind what the driver itself needs of the scratch memory.
    VkDeviceAddress patchedInstancesAddress(Part &part, uint32_t i, uint32_t count)
    {
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        device_.next.GetAccelerationStructureBuildSizesKHR(
            device_.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &part.build.info(), &count, &sizes);
        const bool update = infos_[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        return alignUp(
            infos_[i].scratchData.deviceAddress + (update ? sizes.updateScratchSize : sizes.buildScratchSize), 64);
    }

    void patchInstances(InjectedWork &work)
    {
        std::vector<std::pair<uint32_t, TlasInstancesPush>> pushes;
        for (uint32_t i = 0; i < parts_.size(); ++i) {
            Part &part = parts_[i];
            if (part.skipped || !part.build.topLevel() || part.build.geometryCount() != 1)
                continue;
            VkAccelerationStructureGeometryInstancesDataKHR &instances = part.build.geometry(0).geometry.instances;
            part.instanceRange = ranges_[i][0];
            const uint32_t count = part.instanceRange.primitiveCount;
            const auto slots = slotsFor(device_, *part.target, count);
            if (!slots) {
                refuse(part, i, "VELLUM-out-of-slots",
                       "more than 2^24 instances in all acceleration structures together, or no "
                       "memory for the layer's tables");
                continue;
            }
            TlasInstancesPush push{};
            push.source = instances.data.deviceAddress + part.instanceRange.primitiveOffset;
            push.target = patchedInstancesAddress(part, i, count);
            push.root = device_.root.address();
            push.count = count;
            push.firstSlot = slots->first();
            push.arrayOfPointers = instances.arrayOfPointers;
            instances.arrayOfPointers = VK_FALSE;
            instances.data.deviceAddress = push.target;
            part.instanceRange.primitiveOffset = 0;
            if (count > 0)
                pushes.emplace_back(i, push);
        }
        if (pushes.empty())
            return;
        work.barrier();
        for (const auto &[i, push] : pushes)
            parts_[i].skipped = !work.dispatch(InjectedShader::TlasInstances, push, push.count, 64);
        work.barrier();
    }

    void runDriver()
    {
        std::vector<BuildInfo> infos;
        std::vector<const RangeInfo *> ranges;
        for (uint32_t i = 0; i < parts_.size(); ++i) {
            Part &part = parts_[i];
            if (part.skipped)
                continue;
            infos.push_back(part.build.info());
            const bool patched = part.build.topLevel() && part.build.geometryCount() == 1;
            ranges.push_back(patched ? &part.instanceRange : ranges_[i]);
        }
        if (!infos.empty())
            device_.next.CmdBuildAccelerationStructuresKHR(commandBuffer_, static_cast<uint32_t>(infos.size()),
                                                           infos.data(), ranges.data());
    }

    void writeRecords(InjectedWork &work)
    {
        const bool any = std::any_of(parts_.begin(), parts_.end(), [](const Part &p) { return !p.skipped && p.cell; });
        if (!any)
            return;
        work.barrier();
        for (uint32_t i = 0; i < parts_.size(); ++i) {
            Part &part = parts_[i];
            if (part.skipped || !part.cell)
                continue;
            if (!part.tail) {
                BlasRecordsPush push{};
                push.cell = part.cell;
                work.dispatch(InjectedShader::BlasRecords, push, 1, 64);
                continue;
            }
            writeRecords(work, part, ranges_[i]);
        }
        work.barrier();
    }

    void writeRecords(InjectedWork &work, const Part &part, const RangeInfo *ranges)
    {
        const uint32_t geometries = part.build.geometryCount();
        VkDeviceAddress triangles = part.tail + geometries * kGeometryRecordBytes;
        for (uint32_t g = 0; g < geometries; ++g) {
            BlasRecordsPush push{};
            push.geometryRecord = part.tail + g * kGeometryRecordBytes;
            push.firstGeometryRecord = part.tail;
            push.geometryWord = part.build.opaque(g) ? kGeometryRecordOpaque : 0;
            push.cell = g == 0 ? part.cell : 0;
            if (const auto *micromap = part.build.micromap(g)) {
                push.triangleCount = ranges[g].primitiveCount;
                push.triangleRecords = triangles;
                push.geometryWord |= static_cast<uint32_t>((triangles - part.tail) / kTriangleRecordBytes)
                                     << kGeometryTrianglesShift;
                push.micromap = micromapAddress(device_, micromap->micromap);
                push.baseTriangle = micromap->baseTriangle;
                setIndices(push, *micromap);
                triangles += alignUp(push.triangleCount * kTriangleRecordBytes, 16);
            }
            work.dispatch(InjectedShader::BlasRecords, push, std::max(push.triangleCount, 1u), 64);
        }
    }

    void setIndices(BlasRecordsPush &push, const VkAccelerationStructureTrianglesOpacityMicromapEXT &micromap)
    {
        // VUID-...-indexType-10719: UINT16, UINT32 or NONE_KHR
        if (micromap.indexType == VK_INDEX_TYPE_NONE_KHR || micromap.indexBuffer.deviceAddress == 0)
            return;
        push.indices = micromap.indexBuffer.deviceAddress;
        push.indexBytes = micromap.indexType == VK_INDEX_TYPE_UINT16 ? 2 : 4;
        push.indexStride = static_cast<uint32_t>(micromap.indexStride);
        const VkDeviceSize bytes = device_.addresses.bytesFrom(push.indices);
        VkDeviceSize readable = bytes < push.indexBytes ? 0 : UINT32_MAX;
        if (readable > 0 && push.indexStride > 0)
            readable = std::min<VkDeviceSize>((bytes - push.indexBytes) / push.indexStride + 1, UINT32_MAX);
        push.readable = static_cast<uint32_t>(readable);
    }

    Device &device_;
    VkCommandBuffer commandBuffer_;
    const BuildInfo *infos_;
    const RangeInfo *const *ranges_;
    std::vector<Part> parts_;
};

} // namespace

VKAPI_ATTR VkResult VKAPI_CALL createAccelerationStructure(VkDevice handle,
                                                           const VkAccelerationStructureCreateInfoKHR *info,
                                                           const VkAllocationCallbacks *allocator,
                                                           VkAccelerationStructureKHR *result)
{
    Device &device = deviceOf(handle);
    auto structure = std::make_shared<AccelerationStructure>();
    structure->buffer = info->buffer;
    structure->offset = info->offset;
    structure->size = info->size;
    structure->type = info->type;
    const VkResult created = device.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created == VK_SUCCESS)
        device.accelerationStructures.set(*result, std::move(structure));
    return created;
}

VKAPI_ATTR void VKAPI_CALL destroyAccelerationStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                                        const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    if (const auto known = device.accelerationStructures.take(structure); known && known->cell)
        device.root.releaseCell(known->reference);
    device.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VKAPI_ATTR void VKAPI_CALL getAccelerationStructureBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                                              const BuildInfo *info, const uint32_t *maxPrimitives,
                                                              VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    Device &device = deviceOf(handle);
    DriverBuildInfo build(*info);
    device.next.GetAccelerationStructureBuildSizesKHR(handle, type, &build.info(), maxPrimitives, sizes);
    if (build.topLevel() && build.geometryCount() == 1) {
        const VkDeviceSize extra = patchedInstancesBytes(maxPrimitives[0]);
        sizes->buildScratchSize += extra;
        sizes->updateScratchSize += extra;
    } else if (build.hasMicromaps()) {
        const VkDeviceSize tail =
            tailBytes(build, [&](uint32_t g) { return VkDeviceSize{maxPrimitives ? maxPrimitives[g] : 0}; });
        sizes->accelerationStructureSize = alignUp(sizes->accelerationStructureSize, kAlignment) + tail;
    }
}

VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructures(VkCommandBuffer commandBuffer, uint32_t count,
                                                          const BuildInfo *infos, const RangeInfo *const *ranges)
{
    Build(deviceOf(commandBuffer), commandBuffer, count, infos, ranges).record();
}

VKAPI_ATTR void VKAPI_CALL cmdCopyAccelerationStructure(VkCommandBuffer commandBuffer,
                                                        const VkCopyAccelerationStructureInfoKHR *info)
{
    Device &device = deviceOf(commandBuffer);
    const auto source = device.accelerationStructures.get(info->src);
    const auto target = device.accelerationStructures.get(info->dst);
    if (source && target && source != target) {
        std::scoped_lock lock(source->mutex, target->mutex);
        if (source->hasMicromaps) {
            device.report().notAvailable(
                "vkCmdCopyAccelerationStructureKHR of a bottom-level structure with micromaps");
            return;
        }
        if (source->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR && !source->slots) {
            device.report().notAvailable(
                "vkCmdCopyAccelerationStructureKHR of a top-level structure, recorded before its build,");
            return;
        }
        // The copy holds the same slots as its source, which gets new ones when it is built again.
        if (source->slots && source->slots != target->slots) {
            retireSlots(*target);
            target->slots = source->slots;
        }
    }
    device.next.CmdCopyAccelerationStructureKHR(commandBuffer, info);
    forgetMicromaps(device, commandBuffer, info->dst);
}

VKAPI_ATTR void VKAPI_CALL cmdCopyMemoryToAccelerationStructure(VkCommandBuffer commandBuffer,
                                                                const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    Device &device = deviceOf(commandBuffer);
    device.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, info);
    forgetMicromaps(device, commandBuffer, info->dst);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructuresIndirect(VkCommandBuffer commandBuffer, uint32_t,
                                                                  const BuildInfo *, const VkDeviceAddress *,
                                                                  const uint32_t *, const uint32_t *const *)
{
    deviceOf(commandBuffer).report().notAvailable("vkCmdBuildAccelerationStructuresIndirectKHR");
}

VKAPI_ATTR VkResult VKAPI_CALL buildAccelerationStructures(VkDevice handle, VkDeferredOperationKHR, uint32_t,
                                                           const BuildInfo *, const RangeInfo *const *)
{
    deviceOf(handle).report().notAvailable("vkBuildAccelerationStructuresKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR void VKAPI_CALL cmdCopyAccelerationStructureToMemory(VkCommandBuffer commandBuffer,
                                                                const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    Device &device = deviceOf(commandBuffer);
    if (const auto source = device.accelerationStructures.get(info->src)) {
        std::lock_guard lock(source->mutex);
        if (source->cell) {
            device.report().notAvailable(
                "vkCmdCopyAccelerationStructureToMemoryKHR of a bottom-level structure with micromaps");
            return;
        }
        if (source->slots)
            device.report().warning(
                "VELLUM-serialized-slots",
                "a deserialized top-level structure has the right custom indices and micromaps only "
                "while the one it was made from exists and is not built again");
    }
    device.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, info);
}

} // namespace vellum::layer
