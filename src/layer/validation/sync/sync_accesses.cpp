// SPDX-License-Identifier: Apache-2.0
// The accesses of commands, and messages about accesses that nothing orders.
#include <algorithm>
#include <unordered_set>

#include "layer/validation/sync/sync_checks.h"

namespace vellum::layer::sync
{
namespace
{

constexpr VkDeviceSize kStructureAlignment = 256; // of offsets in buffers

std::string stagesText(VkPipelineStageFlags2 stages)
{
    if (stages & VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR)
        return "ACCELERATION_STRUCTURE_BUILD";
    if (stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT)
        return "MICROMAP_BUILD";
    return "COPY";
}

// The access that a program should name: the last of those that are accepted.
std::string accessText(const Access &access)
{
    const VkAccessFlags2 accesses = access.scope.accesses;
    if (access.writes) {
        return accesses & VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR ? "ACCELERATION_STRUCTURE_WRITE"
               : accesses & VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT             ? "MICROMAP_WRITE"
                                                                           : "TRANSFER_WRITE";
    }
    return accesses & VK_ACCESS_2_SHADER_READ_BIT             ? "SHADER_READ"
           : accesses & VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT ? "INDIRECT_COMMAND_READ"
           : accesses & VK_ACCESS_2_MICROMAP_READ_BIT_EXT     ? "MICROMAP_READ"
           : accesses & VK_ACCESS_2_TRANSFER_READ_BIT         ? "TRANSFER_READ"
                                                              : "ACCELERATION_STRUCTURE_READ";
}

const char *whereText(const Hazard &hazard)
{
    return hazard.sameBatch ? " in the same batch" : hazard.sameQueue ? " in an earlier batch" : " on another queue";
}

std::string reasonText(const Hazard &hazard)
{
    const std::string stage = stagesText(hazard.later.scope.stages);
    if (hazard.kind == HazardKind::Ownership)
        return "the buffer is exclusive, and this queue family has not acquired it";
    if (!hazard.sameQueue)
        return "no semaphore orders the two";
    if (hazard.kind == HazardKind::WriteAfterRead)
        return "no barrier orders stage " + stagesText(hazard.earlier.scope.stages) + " before stage " + stage;
    if (!hazard.executionOrdered)
        return "no barrier makes the write (stage " + stagesText(hazard.earlier.scope.stages) + ", access " +
               accessText(hazard.earlier) + ") available to stage " + stage + ", access " + accessText(hazard.later);
    return "a barrier orders the stages, but does not make access " + accessText(hazard.earlier) +
           " available to stage " + stage + ", access " + accessText(hazard.later);
}

} // namespace

Location locationOf(const ValidatedStructure *structure)
{
    if (!structure)
        return {};
    const VkDeviceSize bytes = std::min(structure->size, kStructureAlignment);
    return {memoryIn(structure->buffer.get(), structure->offset, bytes),
            structure->buffer && structure->buffer->exclusive, structure->handle};
}

Location locationAt(const DeviceModel &device, VkDeviceAddress address, VkDeviceSize size)
{
    const AddressMap::Location found = device.buffers.addresses.find(address);
    const auto buffer = found.buffer ? device.objects.buffers.get(found.buffer) : nullptr;
    if (!buffer || size == 0)
        return {};
    return {memoryIn(buffer.get(), found.offset, size), buffer->exclusive, buffer->handle, buffer, address};
}

Location locationIn(const DeviceModel &device, VkBuffer handle, VkDeviceSize offset, VkDeviceSize size)
{
    const auto buffer = device.objects.buffers.get(handle);
    constexpr VkFlags64 interesting =
        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
        VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    if (!buffer || (buffer->usage & interesting) == 0)
        return {};
    return {memoryIn(buffer.get(), offset, size), buffer->exclusive, buffer->handle, buffer};
}

void report(DeviceModel &device, const Hazard &hazard, const ByInstance *by)
{
    const char *id = hazard.kind == HazardKind::ReadAfterWrite    ? "VELLUM-sync-read-after-write"
                     : hazard.kind == HazardKind::WriteAfterRead  ? "VELLUM-sync-write-after-read"
                     : hazard.kind == HazardKind::WriteAfterWrite ? "VELLUM-sync-write-after-write"
                                                                  : "VELLUM-sync-ownership";
    const Access &later = hazard.later;
    std::string text = placeOf(later);
    text += text.find(": ") == std::string::npos ? ": " : " ";
    if (by)
        text += "builds " + device.nameOf(by->top) + " and ";
    text += later.writes ? "writes " : "reads ";
    text += std::string(later.subject) + " " + device.nameOf(later.object) +
            (by ? ", of instance " + std::to_string(by->instance) + "," : std::string()) + " that " +
            placeOf(hazard.earlier) + (hazard.earlier.writes ? " wrote" : " read");
    if (hazard.earlier.object.handle != later.object.handle)
        text += std::string(" as ") + hazard.earlier.subject + " " + device.nameOf(hazard.earlier.object);
    text += whereText(hazard) + std::string("; ") + reasonText(hazard);
    if (by && by->others != 0)
        text += "; the same is true of " + (by->others == 1 ? "the structure of another instance"
                                                            : "those of " + std::to_string(by->others) + " others");
    device.driver.report().error(id, text, later.object.type, later.object.handle);
}

void reportDestroyed(DeviceModel &device, const Submission &submission, const char *command,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures)
{
    for (const auto &structure : structures) {
        const char *lost = structure->destroyed ? "it was destroyed" : lacksMemory(device, *structure);
        if (lost)
            device.at(Place(command), structure->handle)
                .report(submission.invalidId, nullptr,
                        (structure->isMicromap() ? "micromap " : "structure ") + device.nameOf(structure->handle) +
                            ": when the command buffer is submitted, " + lost);
    }
}

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
    Recorder(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command)
        : sync_(sync), commandBuffer_(commandBuffer), command_(command)
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
    // `reference`: as of Access.
    void writes(const char *subject, Scope scope, const Location &location, VkDeviceAddress reference = 0)
    {
        add(subject, scope, location, true, reference);
    }
    void refers(const char *subject, const std::shared_ptr<ValidatedStructure> &structure)
    {
        if (!structure)
            return;
        if (referred_.insert(structure.get()).second)
            structures_.push_back(structure);
        uses(subject, structure, 0);
        uses(subject, structure->buffer, structure->bufferAddress());
    }
    // An object that must not be destroyed before the command is complete. `address`: of CommandUse.
    void uses(const char *subject, const std::shared_ptr<ReferredObject> &object, VkDeviceAddress address)
    {
        // Geometries often have their data in the same buffers.
        const auto recent = uses_.end() - std::min<ptrdiff_t>(std::ssize(uses_), 4);
        if (object && std::none_of(recent, uses_.end(), [&](const Use &use) { return use.object == object; }))
            uses_.push_back(
                {object,
                 {.command = command_, .array = array_, .element = element_, .subject = subject, .address = address}});
    }

    void record()
    {
        if (accesses_.empty() && uses_.empty())
            return;
        if (!structures_.empty())
            sync_.device.logs.addCheck(
                commandBuffer_,
                [&sync = sync_, command = command_, structures = std::move(structures_)](const Submission &submission) {
                    reportDestroyed(sync.device, submission, command, structures);
                });
        sync_.device.logs.add(commandBuffer_, [&sync = sync_, accesses = std::move(accesses_),
                                               uses = std::move(uses_)](const Submission &submission) {
            for (const Use &use : uses) {
                // Another buffer may have the address by now.
                const bool other = use.object->destroyed && use.use.address != 0;
                const std::shared_ptr<ReferredObject> object =
                    other ? bufferAt(sync.device, use.use.address) : use.object;
                if (object)
                    addUse(*object, submission, use.use);
            }
            for (const Hazard &hazard : sync.tracker.access(uint64_t(submission.queue), accesses))
                report(sync.device, hazard);
        });
    }

private:
    struct Use {
        std::shared_ptr<ReferredObject> object;
        CommandUse use;
    };
    void add(const char *subject, Scope scope, const Location &location, bool writes, VkDeviceAddress reference = 0)
    {
        uses(subject, location.buffer, location.address);
        if (location.range.empty())
            return;
        const Access access{location.range, scope,  writes,   false,   location.exclusive, reference,
                            command_,       array_, element_, subject, location.object};
        // A build names a micromap again for each geometry.
        if (accesses_.empty() || !(accesses_.back().range == access.range) || accesses_.back().writes != writes)
            accesses_.push_back(access);
    }

    DeviceSync &sync_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    const char *array_ = nullptr;
    uint32_t element_ = 0;
    std::vector<Access> accesses_;
    std::vector<std::shared_ptr<ValidatedStructure>> structures_;
    std::unordered_set<const ValidatedStructure *> referred_; // those in structures_
    std::vector<Use> uses_;
};

const char *subjectOf(const std::shared_ptr<ValidatedStructure> &structure)
{
    return structure && structure->isMicromap() ? "micromap" : "acceleration structure";
}

void readStructure(Recorder &recorder, Scope scope, const std::shared_ptr<ValidatedStructure> &structure)
{
    recorder.refers(subjectOf(structure), structure);
    recorder.reads(subjectOf(structure), scope, locationOf(structure.get()));
}

void writeStructure(Recorder &recorder, Scope scope, const std::shared_ptr<ValidatedStructure> &structure)
{
    recorder.refers(subjectOf(structure), structure);
    const bool mayBeNamed =
        structure && !structure->isMicromap() && structure->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    recorder.writes(subjectOf(structure), scope, locationOf(structure.get()),
                    mayBeNamed ? structure->referenceAddress.load() : 0);
}

// The accesses of copies and queries to a structure, by its extension. An unknown structure is not accessed.
Scope copyScope(const std::shared_ptr<ValidatedStructure> &structure, bool writes)
{
    if (structure && structure->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT)
        return {kMicromapBuild, writes ? kMicromapWrite : kMicromapRead};
    return {kStructureCopy, writes ? kStructureWrite : kStructureRead};
}

// What builds read, by Access::Of: how messages name it, and the accesses, of which there are none where it is not
// looked up how much is read.
struct Reading {
    const char *subject;
    VkAccessFlags2 accesses = 0;
};
constexpr Reading kReadings[] = {
    {"data", kShaderRead},
    {"triangleArray", kShaderRead},
    {"vertexData"},
    {"indexData"},
    {"transformData"},
    {"boxes"},
    {"instances", kShaderRead},
    {"indexBuffer", kIndexRead},
};

// The memory that a build accesses by address, in the stage of builds. `own`: reads and writes of what is built.
void addAccesses(const DeviceSync &sync, Recorder &recorder, std::span<const input::Access> accesses,
                 VkPipelineStageFlags2 stage, VkAccessFlags2 own)
{
    for (const input::Access &access : accesses) {
        const Location location = locationAt(sync.device, access.begin(), access.bytes);
        if (access.of == input::Access::Of::Scratch) {
            recorder.writes("scratch memory", {stage, own}, location);
            continue;
        }
        const Reading &reading = kReadings[static_cast<size_t>(access.of)];
        if (reading.accesses != 0)
            recorder.reads(reading.subject, {stage, reading.accesses}, location);
        else
            recorder.uses(reading.subject, location.buffer, location.address);
    }
}

void addBuild(const DeviceSync &sync, Recorder &recorder, const input::MicromapBuild &build)
{
    const VkPipelineStageFlags2 stage = build.khr ? kBuild : kMicromapBuild;
    const VkAccessFlags2 write = build.khr ? kStructureWrite : kMicromapWrite;
    addAccesses(sync, recorder, build.accesses, stage, write | (build.khr ? kStructureRead : kMicromapRead));
    writeStructure(recorder, {stage, write}, sync.device.objects.structureOf(build.target));
}

void addBuild(const DeviceSync &sync, Recorder &recorder, const input::StructureBuild &build)
{
    for (const input::Geometry &geometry : build.geometries)
        if (geometry.attachment)
            readStructure(recorder, {kBuild, geometry.attachment->khr ? kStructureRead : kMicromapRead},
                          sync.device.objects.structureOf(geometry.attachment->micromap));
    if (build.isUpdate())
        readStructure(recorder, {kBuild, kStructureRead},
                      sync.device.objects.structureOf(build.given->srcAccelerationStructure));
    addAccesses(sync, recorder, build.accesses, kBuild, kStructureRead | kStructureWrite);
    writeStructure(recorder, {kBuild, kStructureWrite},
                   sync.device.objects.structureOf(build.given->dstAccelerationStructure));
}

} // namespace

void recordBuilds(DeviceSync &sync, VkCommandBuffer commandBuffer, const input::Builds &builds)
{
    if (!sync.device.checks.sync)
        return;
    Recorder recorder(sync, commandBuffer, nameOf(builds.command));
    for (const input::MicromapBuild &build : builds.micromaps) {
        recorder.element("pInfos", build.element);
        if (!build.khr || build.hasData)
            addBuild(sync, recorder, build);
    }
    for (const input::StructureBuild &build : builds.structures) {
        recorder.element("pInfos", build.element);
        addBuild(sync, recorder, build);
    }
    for (const input::StructureBuild &build : builds.structures) {
        recorder.element("pIndirectDeviceAddresses", build.element);
        if (!build.geometries.empty() && build.ranges.indirect != 0)
            recorder.reads(
                "ranges", {kBuild, VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT},
                locationAt(sync.device, build.ranges.indirect, sizeof(VkAccelerationStructureBuildRangeInfoKHR)));
    }
    recorder.record();
}

// ------------------------------------------------------------------------------------------ copies and queries

void recordCopy(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command,
                const std::shared_ptr<ValidatedStructure> &source, const std::shared_ptr<ValidatedStructure> &target)
{
    if (!sync.device.checks.sync)
        return;
    Recorder recorder(sync, commandBuffer, command);
    readStructure(recorder, copyScope(source, false), source);
    writeStructure(recorder, copyScope(target, true), target);
    recorder.record();
}

void recordSerialization(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command,
                         const std::shared_ptr<ValidatedStructure> &source, VkDeviceAddress target)
{
    if (!sync.device.checks.sync)
        return;
    Recorder recorder(sync, commandBuffer, command);
    const Scope scope = copyScope(source, false);
    readStructure(recorder, scope, source);
    recorder.writes("serialized data", {scope.stages, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                    locationAt(sync.device, target, kHeader));
    recorder.record();
}

void recordDeserialization(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command, VkDeviceAddress source,
                           const std::shared_ptr<ValidatedStructure> &target)
{
    if (!sync.device.checks.sync)
        return;
    Recorder recorder(sync, commandBuffer, command);
    const Scope scope = copyScope(target, true);
    recorder.reads("serialized data", {scope.stages, VK_ACCESS_2_TRANSFER_READ_BIT},
                   locationAt(sync.device, source, kHeader));
    writeStructure(recorder, scope, target);
    recorder.record();
}

void recordQuery(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command, const char *array,
                 const std::vector<std::shared_ptr<ValidatedStructure>> &structures)
{
    if (!sync.device.checks.sync)
        return;
    Recorder recorder(sync, commandBuffer, command);
    for (uint32_t i = 0; i < structures.size(); ++i) {
        recorder.element(array, i);
        readStructure(recorder, copyScope(structures[i], false), structures[i]);
    }
    recorder.record();
}

void recordUse(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command,
               const std::shared_ptr<ValidatedQueryPool> &pool)
{
    if (!sync.device.checks.sync || !pool)
        return;
    sync.device.logs.addCheck(commandBuffer, [&sync, command, pool](const Submission &submission) {
        if (pool->destroyed)
            sync.device.at(Place(command), pool->handle)
                .report(submission.invalidId, nullptr,
                        "query pool " + sync.device.nameOf(pool->handle) +
                            ": when the command buffer is submitted, it was destroyed");
    });
    sync.device.logs.add(commandBuffer, [command, pool](const Submission &submission) {
        addUse(*pool, submission, {.command = command, .subject = "query pool"});
    });
}

// ------------------------------------------------------------------------------------------ transfers

namespace
{

// The memory of a transfer: a part of a buffer, or without a buffer an address range. It is looked up when the command
// is executed.
struct TransferMemory {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize begin = 0, size = 0;

    [[nodiscard]] Location location(const DeviceModel &device) const
    {
        return buffer ? locationIn(device, buffer, begin, size) : locationAt(device, begin, size);
    }
};

// One region of a transfer. `array`: null if the command has one. `source`: its size is 0 if nothing is read.
struct TransferRegion {
    const char *command;
    const char *array;
    uint32_t index;
    TransferMemory source, target;
};

void record(DeviceSync &sync, VkCommandBuffer commandBuffer, const TransferRegion &region)
{
    if (!sync.device.checks.sync)
        return;
    sync.device.logs.add(commandBuffer, [&sync, region](const Submission &submission) {
        std::vector<Access> accesses;
        for (const bool writes : {false, true}) {
            const TransferMemory &memory = writes ? region.target : region.source;
            const Location location = memory.size != 0 ? memory.location(sync.device) : Location{};
            if (location.buffer)
                addUse(*location.buffer, submission,
                       {.command = region.command,
                        .array = region.array,
                        .element = region.index,
                        .subject = memory.buffer ? "buffer" : "memory",
                        .address = location.address});
            const VkAccessFlags2 access = writes ? VK_ACCESS_2_TRANSFER_WRITE_BIT : VK_ACCESS_2_TRANSFER_READ_BIT;
            if (!location.range.empty())
                accesses.push_back({location.range,
                                    {kTransfer, access},
                                    writes,
                                    true,
                                    location.exclusive,
                                    0,
                                    region.command,
                                    region.array,
                                    region.index,
                                    memory.buffer ? "buffer" : "memory",
                                    location.object});
        }
        for (const Hazard &hazard : sync.tracker.access(uint64_t(submission.queue), accesses))
            report(sync.device, hazard);
    });
}

} // namespace

void recordCopy(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command, VkBuffer from, VkBuffer to,
                const VkBufferCopy &region, uint32_t index)
{
    record(sync, commandBuffer,
           {command, "pRegions", index, {from, region.srcOffset, region.size}, {to, region.dstOffset, region.size}});
}

void recordWrite(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command, VkBuffer to, VkDeviceSize offset,
                 VkDeviceSize size)
{
    record(sync, commandBuffer, {command, nullptr, 0, {}, {to, offset, size}});
}

void recordCopy(DeviceSync &sync, VkCommandBuffer commandBuffer, const VkCopyDeviceMemoryInfoKHR &info)
{
    for (uint32_t r = 0; r < info.regionCount; ++r) {
        const VkDeviceAddressRangeKHR &from = info.pRegions[r].srcRange, &to = info.pRegions[r].dstRange;
        record(sync, commandBuffer,
               {"vkCmdCopyMemoryKHR",
                "pRegions",
                r,
                {VK_NULL_HANDLE, from.address, from.size},
                {VK_NULL_HANDLE, to.address, to.size}});
    }
}

void recordWrite(DeviceSync &sync, VkCommandBuffer commandBuffer, const char *command,
                 const VkDeviceAddressRangeKHR &range)
{
    record(sync, commandBuffer, {command, nullptr, 0, {}, {VK_NULL_HANDLE, range.address, range.size}});
}

} // namespace vellum::layer::sync
