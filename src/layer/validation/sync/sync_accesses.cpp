// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/sync/sync_accesses.h"

#include <algorithm>

#include "layer/validation/builds.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/sync/sync_ranges.h"
#include "layer/validation/sync/sync_report.h"

namespace vellum::layer::sync
{
namespace
{

constexpr VkPipelineStageFlags2 kBuild = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
constexpr VkPipelineStageFlags2 kMicromapBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
constexpr VkPipelineStageFlags2 kStructureCopy =
    VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_COPY_BIT_KHR | VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
constexpr VkPipelineStageFlags2 kTransfer = VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT;

constexpr VkAccessFlags2 kStructureRead = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR;
constexpr VkAccessFlags2 kStructureWrite = VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;
constexpr VkAccessFlags2 kMicromapRead = VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
constexpr VkAccessFlags2 kMicromapWrite = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
constexpr VkAccessFlags2 kShaderRead =
    VK_ACCESS_2_SHADER_READ_BIT | VK_ACCESS_2_SHADER_SAMPLED_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_READ_BIT;
// The specification does not state how a build reads indices of micromaps; the proposal has a transfer.
constexpr VkAccessFlags2 kIndexRead = kShaderRead | VK_ACCESS_2_TRANSFER_READ_BIT | kStructureRead;

constexpr VkDeviceSize kHeader = 2 * VK_UUID_SIZE + 3 * sizeof(uint64_t); // of serialized data

// The accesses of one command.
class Recorder
{
public:
    Recorder(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command)
        : device_(device), commandBuffer_(commandBuffer), command_(command)
    {
    }
    Recorder(const Recorder &) = delete;
    Recorder &operator=(const Recorder &) = delete;
    ~Recorder() = default;

    void element(const char *array, uint32_t index)
    {
        array_ = array;
        element_ = index;
    }
    void reads(const char *subject, Scope scope, const Location &location) { add(subject, scope, location, false); }
    void writes(const char *subject, Scope scope, const Location &location) { add(subject, scope, location, true); }
    void transfers() { transfer_ = true; }
    void refers(const std::shared_ptr<ValidatedStructure> &structure)
    {
        if (structure)
            structures_.push_back(structure);
    }

    void record()
    {
        if (accesses_.empty() && structures_.empty())
            return;
        device_.logs.add(commandBuffer_, [&device = device_, command = command_, accesses = std::move(accesses_),
                                          structures = std::move(structures_)](const Submission &submission) {
            reportDestroyed(device, command, structures);
            for (const Hazard &hazard : device.sync.tracker.access(uint64_t(submission.queue), accesses))
                report(device, hazard);
        });
    }

private:
    void add(const char *subject, Scope scope, const Location &location, bool writes)
    {
        if (location.range.empty())
            return;
        const Access access{location.range, scope,  writes,   transfer_, location.exclusive,
                            command_,       array_, element_, subject,   location.object};
        // A build names a micromap again for each geometry.
        if (accesses_.empty() || !(accesses_.back().range == access.range) || accesses_.back().writes != writes)
            accesses_.push_back(access);
    }

    DeviceValidation &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    const char *array_ = nullptr;
    uint32_t element_ = 0;
    bool transfer_ = false;
    std::vector<Access> accesses_;
    std::vector<std::shared_ptr<ValidatedStructure>> structures_;
};

const char *subjectOf(const std::shared_ptr<ValidatedStructure> &structure)
{
    return structure && structure->isMicromap() ? "micromap" : "acceleration structure";
}

void readStructure(Recorder &recorder, Scope scope, const std::shared_ptr<ValidatedStructure> &structure)
{
    recorder.refers(structure);
    recorder.reads(subjectOf(structure), scope, locationOf(structure.get()));
}

void writeStructure(Recorder &recorder, Scope scope, const std::shared_ptr<ValidatedStructure> &structure)
{
    recorder.refers(structure);
    recorder.writes(subjectOf(structure), scope, locationOf(structure.get()));
}

// How copies and queries access a structure, by the extension that it is of. An unknown one is not accessed.
Scope copyScope(const std::shared_ptr<ValidatedStructure> &structure, bool writes)
{
    if (structure && structure->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT)
        return {kMicromapBuild, writes ? kMicromapWrite : kMicromapRead};
    return {kStructureCopy, writes ? kStructureWrite : kStructureRead};
}

void addMicromapBuild(const DeviceValidation &device, Recorder &recorder, const MicromapBuildInput &build,
                      VkPipelineStageFlags2 stage, VkAccessFlags2 write, VkAccessFlags2 scratchAccess, uint64_t scratch)
{
    const uint64_t triangles = build.triangleCount();
    if (triangles > 0) {
        const uint64_t bytes = (triangles - 1) * build.triangleStride + sizeof(VkMicromapTriangleEXT);
        recorder.reads("triangleArray", {stage, kShaderRead}, locationAt(device, build.triangles.deviceAddress, bytes));
        // Where in it triangles have their data is not known to the host. Offset 0 is used.
        recorder.reads("data", {stage, kShaderRead}, locationAt(device, build.data.deviceAddress, 1));
    }
    recorder.writes("scratch memory", {stage, scratchAccess}, locationAt(device, build.scratch.deviceAddress, scratch));
    writeStructure(recorder, {stage, write}, build.target);
}

void addAttachment(const DeviceValidation &device, Recorder &recorder,
                   const VkAccelerationStructureGeometryKHR &geometry,
                   const VkAccelerationStructureBuildRangeInfoKHR *range)
{
    const auto attachment = attachmentOf(device, geometry);
    if (!attachment)
        return;
    readStructure(recorder, {kBuild, attachment->khr ? kStructureRead : kMicromapRead}, attachment->micromap);
    const uint32_t bytes = indexBytes(attachment->indexType);
    if (range && range->primitiveCount > 0 && bytes != 0)
        recorder.reads("indexBuffer", {kBuild, kIndexRead},
                       locationAt(device, attachment->indexBuffer.deviceAddress,
                                  (range->primitiveCount - 1) * attachment->indexStride + bytes));
}

void addInstances(const DeviceValidation &device, Recorder &recorder,
                  const VkAccelerationStructureGeometryInstancesDataKHR &instances,
                  const VkAccelerationStructureBuildRangeInfoKHR *range)
{
    if (!range || range->primitiveCount == 0)
        return;
    recorder.reads("instances", {kBuild, kShaderRead},
                   locationAt(device, instances.data.deviceAddress + range->primitiveOffset,
                              range->primitiveCount * instanceStride(instances)));
}

void addStructureBuild(const DeviceValidation &device, Recorder &recorder,
                       const VkAccelerationStructureBuildGeometryInfoKHR &info,
                       const VkAccelerationStructureBuildRangeInfoKHR *ranges)
{
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        const VkAccelerationStructureGeometryKHR *geometry = geometryOf(info, g);
        if (!geometry)
            break;
        addAttachment(device, recorder, *geometry, ranges ? &ranges[g] : nullptr);
        if (geometry->geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR)
            addInstances(device, recorder, geometry->geometry.instances, ranges ? &ranges[g] : nullptr);
    }
    const bool update = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    const uint64_t scratch = device.sync.scratch.smallest(ScratchSizes::kindOf(info.type, update));
    if (update)
        readStructure(recorder, {kBuild, kStructureRead}, device.objects.structures.get(info.srcAccelerationStructure));
    recorder.writes("scratch memory", {kBuild, kStructureRead | kStructureWrite},
                    locationAt(device, info.scratchData.deviceAddress, scratch));
    writeStructure(recorder, {kBuild, kStructureWrite}, device.objects.structures.get(info.dstAccelerationStructure));
}

} // namespace

void recordBuilds(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                  const VkMicromapBuildInfoEXT *infos)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, "vkCmdBuildMicromapsEXT");
    for (uint32_t i = 0; i < count; ++i) {
        recorder.element("pInfos", i);
        addMicromapBuild(device, recorder, micromapBuildOf(device, infos[i]), kMicromapBuild, kMicromapWrite,
                         kMicromapRead | kMicromapWrite, device.sync.scratch.smallest(ScratchSizes::kMicromapExt));
    }
    recorder.record();
}

void recordBuilds(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command, uint32_t count,
                  const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                  const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    for (uint32_t i = 0; i < count; ++i) {
        recorder.element("pInfos", i);
        if (!buildsMicromap(infos[i]))
            addStructureBuild(device, recorder, infos[i], ranges ? ranges[i] : nullptr);
        else if (const auto build = micromapBuildOf(device, infos[i]))
            addMicromapBuild(device, recorder, *build, kBuild, kStructureWrite, kStructureRead | kStructureWrite,
                             device.sync.scratch.smallest(ScratchSizes::kindOf(infos[i].type, false)));
    }
    recorder.record();
}

void recordIndirectRanges(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                          const VkAccelerationStructureBuildGeometryInfoKHR *infos, const VkDeviceAddress *addresses)
{
    if (!device.checks.sync || !addresses)
        return;
    Recorder recorder(device, commandBuffer, "vkCmdBuildAccelerationStructuresIndirectKHR");
    for (uint32_t i = 0; i < count; ++i) {
        recorder.element("pIndirectDeviceAddresses", i);
        if (infos[i].geometryCount > 0 && !buildsMicromap(infos[i]))
            recorder.reads("ranges", {kBuild, VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT},
                           locationAt(device, addresses[i], sizeof(VkAccelerationStructureBuildRangeInfoKHR)));
    }
    recorder.record();
}

// ------------------------------------------------------------------------------------------ copies and queries

void recordCopy(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command,
                const std::shared_ptr<ValidatedStructure> &source, const std::shared_ptr<ValidatedStructure> &target)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    readStructure(recorder, copyScope(source, false), source);
    writeStructure(recorder, copyScope(target, true), target);
    recorder.record();
}

void recordSerialization(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command,
                         const std::shared_ptr<ValidatedStructure> &source, VkDeviceAddress target)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    const Scope scope = copyScope(source, false);
    readStructure(recorder, scope, source);
    recorder.writes("serialized data", {scope.stages, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                    locationAt(device, target, kHeader));
    recorder.record();
}

void recordDeserialization(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command,
                           VkDeviceAddress source, const std::shared_ptr<ValidatedStructure> &target)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    const Scope scope = copyScope(target, true);
    recorder.reads("serialized data", {scope.stages, VK_ACCESS_2_TRANSFER_READ_BIT},
                   locationAt(device, source, kHeader));
    writeStructure(recorder, scope, target);
    recorder.record();
}

void recordQuery(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command, const char *array,
                 const std::vector<std::shared_ptr<ValidatedStructure>> &structures)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    for (uint32_t i = 0; i < structures.size(); ++i) {
        recorder.element(array, i);
        readStructure(recorder, copyScope(structures[i], false), structures[i]);
    }
    recorder.record();
}

// ------------------------------------------------------------------------------------------ transfers

void recordCopy(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command, VkBuffer from,
                VkBuffer to, const VkBufferCopy &region, uint32_t index)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    recorder.element("pRegions", index);
    recorder.transfers();
    recorder.reads("buffer", {kTransfer, VK_ACCESS_2_TRANSFER_READ_BIT},
                   locationIn(device, from, region.srcOffset, region.size));
    recorder.writes("buffer", {kTransfer, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                    locationIn(device, to, region.dstOffset, region.size));
    recorder.record();
}

void recordWrite(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command, VkBuffer to,
                 VkDeviceSize offset, VkDeviceSize size)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    recorder.transfers();
    recorder.writes("buffer", {kTransfer, VK_ACCESS_2_TRANSFER_WRITE_BIT}, locationIn(device, to, offset, size));
    recorder.record();
}

void recordCopy(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyDeviceMemoryInfoKHR &info)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, "vkCmdCopyMemoryKHR");
    recorder.transfers();
    for (uint32_t r = 0; r < info.regionCount; ++r) {
        const VkDeviceMemoryCopyKHR &region = info.pRegions[r];
        recorder.element("pRegions", r);
        recorder.reads("memory", {kTransfer, VK_ACCESS_2_TRANSFER_READ_BIT},
                       locationAt(device, region.srcRange.address, region.srcRange.size));
        recorder.writes("memory", {kTransfer, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                        locationAt(device, region.dstRange.address, region.dstRange.size));
    }
    recorder.record();
}

void recordWrite(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *command,
                 const VkDeviceAddressRangeKHR &range)
{
    if (!device.checks.sync)
        return;
    Recorder recorder(device, commandBuffer, command);
    recorder.transfers();
    recorder.writes("memory", {kTransfer, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                    locationAt(device, range.address, range.size));
    recorder.record();
}

} // namespace vellum::layer::sync
