#include "layer/structures/structure_build.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <unordered_set>

#include "core/records.h"
#include "layer/ground/atomic_max.h"
#include "layer/ground/judge.h"
#include "layer/micromaps/micromap.h"
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
using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

constexpr VkDeviceSize kGeometryRecordBytes = kGeometryRecordWords * 4;
constexpr VkDeviceSize kTriangleRecordBytes = kTriangleRecordWords * 4;

// An intersection shader cannot know whether its geometry is opaque: the cell says it.
void setBoxes(uint32_t (&cell)[kCellWords], const DriverBuildInfo &build)
{
    bool alike = true;
    uint32_t opaque = 0;
    for (uint32_t i = 0; i < build.geometryCount(); ++i) {
        alike = alike && build.opaque(i) == build.opaque(0);
        if (build.opaque(i))
            opaque |= 1u << i % 32;
    }
    if (!build.hasBoxes() || (!alike && build.geometryCount() > 32))
        return;
    cell[2] = kCellBoxes;
    cell[7] = alike ? (build.opaque(0) ? ~0u : 0) : opaque;
}

// The ranges of one build, direct or indirect.
struct Ranges {
    const RangeInfo *direct = nullptr; // of each geometry
    VkDeviceAddress indirect = 0;      // of the first geometry's; the next ones are `stride` bytes apart
    uint32_t stride = 0;
    const uint32_t *most = nullptr; // primitives of each geometry, of an indirect build

    // The most primitives that geometry g may have.
    [[nodiscard]] uint32_t primitives(uint32_t g) const { return direct ? direct[g].primitiveCount : most[g]; }
    // Where the device finds geometry g's range; 0 where the host knows it.
    [[nodiscard]] VkDeviceAddress address(uint32_t g) const { return direct ? 0 : indirect + uint64_t{g} * stride; }
};

// One vkCmdBuildAccelerationStructuresKHR or ...IndirectKHR: the patched copies, and the work around the driver's
// build.
class Build
{
public:
    // `ranges`: of each element of `infos`.
    Build(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command, uint32_t count,
          const BuildInfo *infos, const std::vector<Ranges> &ranges)
        : device_(device), commandBuffer_(commandBuffer), command_(command), infos_(infos), ranges_(ranges)
    {
        parts_.reserve(count);
        for (uint32_t i = 0; i < count; ++i) {
            if (isMicromapBuild(infos[i]))
                built_.insert(infos[i].dstAccelerationStructure);
            else
                parts_.emplace_back(i, infos[i]);
        }
    }

    void record()
    {
        for (Part &part : parts_)
            prepare(part);
        InjectedWork work(device_.commands, commandBuffer_);
        patchInstances(work);
        letCellsWait();
        runDriver();
        writeCells();
        writeTails(work);
    }

private:
    struct Part {
        Part(uint32_t index, const BuildInfo &info) : i(index), build(info) {}
        uint32_t i; // of pInfos
        DriverBuildInfo build;
        std::shared_ptr<AccelerationStructure> target;
        std::shared_ptr<AccelerationStructure> source; // of an update; null: it is none
        VkDeviceAddress sourceCell = 0;
        VkDeviceAddress tail = 0; // where the records go; 0: there are none
        VkDeviceSize tailBytes = 0;
        VkDeviceSize driverBytes = 0; // that the driver needs; of a build without records, where that matters only
        CellPlace cell;
        RangeInfo instanceRange{}; // of the patched instances
        TlasInstancesPush instances{};
        bool skipped = false;
    };

    [[nodiscard]] Judge judgeOf(const Part &part) const
    {
        return {device_.driver.report(), command_, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                reinterpret_cast<uint64_t>(infos_[part.i].dstAccelerationStructure), part.i};
    }
    void refuse(Part &part, const char *id, const std::string &text)
    {
        judgeOf(part).refuse(id, text);
        part.skipped = true;
    }

    void prepare(Part &part)
    {
        const uint32_t i = part.i;
        part.target = device_.objects.accelerationStructures.get(infos_[i].dstAccelerationStructure);
        if (!part.target || part.target->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
            refuse(part, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-dstAccelerationStructure-parameter",
                   "dstAccelerationStructure is not an acceleration structure of this device");
            return;
        }
        // Only builds of micromaps have none.
        if (!ranges_[i].direct && !ranges_[i].most) {
            refuse(part, "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543",
                   "a null pointer in place of the geometries' numbers of primitives");
            return;
        }
        if (infos_[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR && sourceIsWrong(part))
            return;
        // The driver does not know the type.
        if (part.build.hasMicromapGeometry()) {
            refuse(part, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                   "a geometry of type VK_GEOMETRY_TYPE_MICROMAP_KHR in a build that is none of a micromap");
            return;
        }
        part.cell = cellOf(device_.objects, *part.target, infos_[i].dstAccelerationStructure);
        if (!part.cell.address) {
            refuse(part, "VELLUM-out-of-memory", "no memory for the layer's tables");
            return;
        }
        if (!part.build.topLevel())
            prepareBottomLevel(part);
        else if (part.build.geometryCount() != 1)
            refuse(part, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03790",
                   "a top-level structure has one geometry");
    }

    // A micromap's handle means nothing to the driver.
    bool sourceIsWrong(Part &part)
    {
        const VkAccelerationStructureKHR handle = infos_[part.i].srcAccelerationStructure;
        part.source = device_.objects.accelerationStructures.get(handle);
        if (part.source && part.source->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
            part.sourceCell = cellOf(device_.objects, *part.source, handle).address;
            return false;
        }
        refuse(part,
               handle ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629"
                      : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630",
               "srcAccelerationStructure is not an acceleration structure of this device that can be updated");
        return true;
    }

    void refuseSmall(Part &part)
    {
        refuse(part, "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
               "dstAccelerationStructure has " + std::to_string(part.target->size) +
                   " bytes, less than vkGetAccelerationStructureBuildSizesKHR gives");
    }

    // A geometry's micromap that is none, or is being built by the same command.
    bool micromapsAreWrong(Part &part)
    {
        for (uint32_t g = 0; g < part.build.geometryCount(); ++g) {
            const MicromapAttachment *attachment = part.build.micromap(g);
            if (!attachment || !attachment->structure)
                continue;
            const std::string where = "geometry " + std::to_string(g) + ": ";
            if (!micromapOf(device_.objects, attachment->structure)) {
                refuse(part, "VELLUM-VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter",
                       where + "micromap is not a micromap of this device");
                return true;
            }
            // Here they are built first, with a barrier.
            if (built_.contains(attachment->structure) &&
                !judgeOf(part).tolerate(
                    "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548",
                    where + "micromap is built by the same command")) {
                part.skipped = true;
                return true;
            }
        }
        return false;
    }

    void prepareBottomLevel(Part &part)
    {
        if (micromapsAreWrong(part))
            return;
        const uint32_t i = part.i;
        AccelerationStructure &target = *part.target;
        atomicMax(device_.objects.mostGeometries, part.build.geometryCount());
        std::vector<uint32_t> primitives(part.build.geometryCount());
        for (uint32_t g = 0; g < part.build.geometryCount(); ++g)
            primitives[g] = ranges_[i].primitives(g);
        part.tailBytes = bottomLevelTailBytes(part.build, primitives.data());
        if (part.tailBytes == 0 && !device_.driver.clearsWholeHandles)
            return becomes(target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, 0);
        const VkDeviceSize driverBytes =
            driverSizes(device_.driver, part.build, primitives.data(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR)
                .accelerationStructureSize;
        if (part.tailBytes == 0) {
            part.driverBytes = std::min(alignUp(driverBytes, 16), target.size);
            return fitBottomLevel(part, part.driverBytes);
        }
        VkDeviceSize offset = alignUp(driverBytes, kPartAlignment);
        const VkDeviceSize bytes = offset + part.tailBytes;
        if (part.tailBytes > target.size || (offset + part.tailBytes > target.size &&
                                             infos_[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR)) {
            refuseSmall(part);
            return;
        }
        // An update of a compacted structure: the records lie where it has them, which the device knows; if it has
        // none, last.
        if (offset + part.tailBytes > target.size)
            offset = (target.size - part.tailBytes) / kPartAlignment * kPartAlignment;
        part.tail = beginOf(device_.driver, target) + offset;
        fitBottomLevel(part, bytes);
    }

    // No more than the build needs is the driver's to write.
    void fitBottomLevel(Part &part, VkDeviceSize bytes)
    {
        // What is updated may be a compacted structure, of fewer bytes.
        const bool known = !part.source || device_.driver.clearsWholeHandles;
        becomes(*part.target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                known ? std::min(bytes, part.target->size) : 0);
        fit(part, bytes);
    }
    void fit(Part &part, VkDeviceSize bytes)
    {
        part.build.setTarget(fittedHandle(device_, *part.target, infos_[part.i].dstAccelerationStructure, bytes));
    }

    void patchInstances(InjectedWork &work)
    {
        bool any = false;
        for (Part &part : parts_) {
            if (part.skipped || !part.build.topLevel())
                continue;
            const uint32_t i = part.i;
            const uint32_t count = ranges_[i].primitives(0);
            const VkBuildAccelerationStructureFlagsKHR flags = infos_[i].flags;
            const VkDeviceSize bytes = topLevelBytes(device_.driver, flags, count);
            if (bytes > part.target->size) {
                refuseSmall(part);
                continue;
            }
            const auto slots = slotsFor(device_.objects, *part.target, count);
            if (!slots) {
                refuse(part, "VELLUM-out-of-slots",
                       "more than 2^24 instances in all acceleration structures together, or no "
                       "memory for the layer's tables");
                continue;
            }
            becomesTopLevel(*part.target, count, bytes);
            fit(part, bytes);
            VkAccelerationStructureGeometryInstancesDataKHR &instances = part.build.geometry(0).geometry.instances;
            TlasInstancesPush &push = part.instances;
            push.source = instances.data.deviceAddress;
            if (ranges_[i].direct)
                push.source += ranges_[i].direct[0].primitiveOffset;
            push.range = ranges_[i].address(0);
            // Behind what the driver itself needs of the scratch memory.
            push.target = alignUp(infos_[i].scratchData.deviceAddress +
                                      topLevelDriverSizes(device_.driver, flags, count).buildScratchSize,
                                  kPatchedAlignment);
            push.root = device_.objects.root.address();
            push.tail = beginOf(device_.driver, *part.target) + topLevelTailOffset(device_.driver, flags, count);
            push.cell = part.cell.address;
            push.count = count;
            push.firstSlot = slots->first();
            push.from = instances.arrayOfPointers ? InstancesFrom::Pointers : InstancesFrom::Array;
            instances.arrayOfPointers = VK_FALSE;
            instances.data.deviceAddress = push.target;
            part.instanceRange = {count, 0, 0, 0};
            any = true;
        }
        if (!any)
            return;
        work.barrier();
        for (Part &part : parts_) {
            if (!part.skipped && part.build.topLevel())
                part.skipped = !work.dispatch(InjectedShader::TlasInstances, part.instances,
                                              std::max(part.instances.count, 1u), 64);
        }
        work.barrier();
    }

    [[nodiscard]] static bool writesPlainCell(const Part &part)
    {
        return !part.skipped && !part.build.topLevel() && !part.tail;
    }

    // A queue that waits for another one's build of a structure, by a semaphore, does so in the stage of builds: the
    // transfer to the structure's cell must come after it, too. Semaphores are waited for before the command buffer
    // begins, so one barrier in each will do, and builds of one command buffer do not wait for each other; in front of
    // the first build, so that none waits for that. (Barriers of one queue are ordered by writeCells. What is waited
    // for in another stage, and then by a later barrier of the application's in the stage of builds, is not.)
    void letCellsWait()
    {
        const auto state = device_.commands.states.get(commandBuffer_);
        if (!state || state->cellsWait || std::none_of(parts_.begin(), parts_.end(), writesPlainCell))
            return;
        const VkMemoryBarrier builds{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr,
                                     VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR |
                                         VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                     VK_ACCESS_TRANSFER_WRITE_BIT};
        device_.driver.next.CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                               VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 1, &builds, 0, nullptr, 0, nullptr);
        state->cellsWait = true;
    }

    void runDriver()
    {
        std::vector<BuildInfo> infos, indirectInfos;
        std::vector<const RangeInfo *> ranges;
        std::vector<VkDeviceAddress> addresses;
        std::vector<uint32_t> strides;
        std::vector<const uint32_t *> most;
        for (Part &part : parts_) {
            if (part.skipped)
                continue;
            const Ranges &given = ranges_[part.i];
            if (part.build.topLevel() || given.direct) {
                // A top-level structure is built for as many instances as there may be; the rest are inactive.
                infos.push_back(part.build.info());
                ranges.push_back(part.build.topLevel() ? &part.instanceRange : given.direct);
            } else {
                indirectInfos.push_back(part.build.info());
                addresses.push_back(given.indirect);
                strides.push_back(given.stride);
                most.push_back(given.most);
            }
        }
        if (!infos.empty())
            device_.driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer_, static_cast<uint32_t>(infos.size()),
                                                                  infos.data(), ranges.data());
        if (!indirectInfos.empty())
            device_.driver.next.CmdBuildAccelerationStructuresIndirectKHR(
                commandBuffer_, static_cast<uint32_t>(indirectInfos.size()), indirectInfos.data(), addresses.data(),
                strides.data(), most.data());
    }

    // Cells of structures without records: what an earlier build put there must not be found any more. Whoever
    // reads or writes a cell in a shader waits for everything before it, and lets everything after it wait. But before
    // it in another command buffer may only be the stage of builds, after a semaphore or an event: the barrier puts the
    // cells before what comes in that stage.
    void writeCells()
    {
        bool any = false;
        for (const Part &part : parts_) {
            if (!writesPlainCell(part))
                continue;
            uint32_t words[kCellWords]{};
            words[2] = kCellPlain;
            setBoxes(words, part.build);
            if (part.driverBytes > 0) {
                const VkDeviceAddress end = beginOf(device_.driver, *part.target) + part.driverBytes;
                std::memcpy(words, &end, sizeof end);
            }
            device_.driver.next.CmdUpdateBuffer(commandBuffer_, part.cell.buffer, part.cell.offset, sizeof words,
                                                words);
            any = true;
        }
        if (!any)
            return;
        const VkMemoryBarrier cells{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_TRANSFER_WRITE_BIT,
                                    VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR};
        device_.driver.next.CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                               VK_PIPELINE_STAGE_TRANSFER_BIT |
                                                   VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                               0, 1, &cells, 0, nullptr, 0, nullptr);
    }

    void writeTails(InjectedWork &work)
    {
        const auto hasTail = [](const Part &p) { return !p.skipped && (p.tail || p.instances.count > 0); };
        if (std::none_of(parts_.begin(), parts_.end(), hasTail))
            return;
        work.barrier();
        for (Part &part : parts_) {
            if (!hasTail(part))
                continue;
            if (part.tail) {
                writeRecords(work, part, ranges_[part.i]);
            } else {
                part.instances.pass = 1;
                work.dispatch(InjectedShader::TlasInstances, part.instances, part.instances.count, 64);
            }
        }
        work.barrier();
    }

    void writeRecords(InjectedWork &work, const Part &part, const Ranges &ranges)
    {
        const uint32_t geometries = part.build.geometryCount();
        VkDeviceSize triangles = geometries * (kGeometryRecordBytes + kMicromapNameWords * 4); // offset in the tail
        for (uint32_t g = 0; g < geometries; ++g) {
            BlasRecordsPush push{};
            push.tail = part.tail;
            push.geometryWord = part.build.opaque(g) ? kGeometryRecordOpaque : 0;
            push.cell = g == 0 ? part.cell.address : 0;
            push.geometryCount = geometries;
            push.geometry = g;
            push.tailUnits = unitsOf(part.tailBytes);
            if (part.source) {
                push.source = part.sourceCell;
                push.sourceBegin = beginOf(device_.driver, *part.source);
                push.begin = beginOf(device_.driver, *part.target);
                push.commonUnits = unitsOf(std::min(part.source->size, part.target->size));
            }
            if (const auto *micromap = part.build.micromap(g)) {
                push.triangleCount = ranges.primitives(g);
                push.range = ranges.address(g);
                push.geometryWord |= static_cast<uint32_t>(triangles / kTriangleRecordBytes) << kGeometryTrianglesShift;
                const VkMicromapEXT handle =
                    micromap->structure ? micromapOf(device_.objects, micromap->structure) : micromap->micromap;
                push.micromap = micromapAddress(device_.driver, handle);
                push.micromapSize = handle ? unitsOf(micromapOf(handle)->size) : 0;
                push.named = micromap->structure != VK_NULL_HANDLE;
                push.baseTriangle = micromap->baseTriangle;
                push.log = device_.commands.complaints.address();
                push.object = complaintObject(handle);
                setIndices(push, *micromap);
                triangles += alignUp(push.triangleCount * kTriangleRecordBytes, 16);
            }
            work.dispatch(InjectedShader::BlasRecords, push, std::max(push.triangleCount, 1u), 64);
        }
    }

    void setIndices(BlasRecordsPush &push, const MicromapAttachment &micromap)
    {
        // VUID-...EXT-indexType-10719: UINT16, UINT32 or NONE_KHR; VUID-...KHR-indexType-11570: UINT8 too.
        if (micromap.indexType == VK_INDEX_TYPE_NONE_KHR || micromap.indexBuffer == 0)
            return;
        push.indices = micromap.indexBuffer;
        push.indexBytes = micromap.indexType == VK_INDEX_TYPE_UINT8_EXT ? 1
                          : micromap.indexType == VK_INDEX_TYPE_UINT16  ? 2
                                                                        : 4;
        push.indexStride = static_cast<uint32_t>(micromap.indexStride);
        const VkDeviceSize bytes = device_.buffers.addresses.bytesFrom(push.indices);
        VkDeviceSize readable = bytes < push.indexBytes ? 0 : UINT32_MAX;
        if (readable > 0 && push.indexStride > 0)
            readable = std::min<VkDeviceSize>((bytes - push.indexBytes) / push.indexStride + 1, UINT32_MAX);
        push.readable = static_cast<uint32_t>(readable);
    }

    DeviceStructures &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    const BuildInfo *infos_;
    const std::vector<Ranges> &ranges_;
    std::vector<Part> parts_;
    std::unordered_set<VkAccelerationStructureKHR> built_; // micromaps, by the same command
};

} // namespace

void cmdBuildAccelerationStructures(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const BuildInfo *infos, const RangeInfo *const *ranges)
{
    reportNotices(device.objects);
    if (InjectedWork::refusedIn(device.commands, commandBuffer, "vkCmdBuildAccelerationStructuresKHR"))
        return;
    cmdBuildMicromapStructures(device.micromaps, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", count, infos);
    std::vector<Ranges> all(count);
    for (uint32_t i = 0; i < count; ++i)
        all[i].direct = ranges ? ranges[i] : nullptr;
    Build(device, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", count, infos, all).record();
}

void cmdBuildAccelerationStructuresIndirect(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const BuildInfo *infos, const VkDeviceAddress *addresses,
                                            const uint32_t *strides, const uint32_t *const *most)
{
    constexpr const char *kCommand = "vkCmdBuildAccelerationStructuresIndirectKHR";
    reportNotices(device.objects);
    if (InjectedWork::refusedIn(device.commands, commandBuffer, kCommand))
        return;
    std::vector<Ranges> all(count);
    for (uint32_t i = 0; i < count; ++i) {
        all[i] = {nullptr, addresses[i], strides[i], most[i]};
        const Judge judge(device.driver.report(), kCommand, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                          reinterpret_cast<uint64_t>(infos[i].dstAccelerationStructure), i);
        // It has no ranges that could be indirect.
        if (isMicromapBuild(infos[i]) &&
            judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557",
                           "a micromap is not built indirectly"))
            cmdBuildMicromapStructures(device.micromaps, commandBuffer, kCommand, 1, &infos[i]);
    }
    Build(device, commandBuffer, kCommand, count, infos, all).record();
}

VkResult buildAccelerationStructures(DeviceStructures &device, VkDevice, VkDeferredOperationKHR, uint32_t,
                                     const BuildInfo *, const RangeInfo *const *)
{
    device.driver.report().notAvailable("vkBuildAccelerationStructuresKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace vellum::layer
