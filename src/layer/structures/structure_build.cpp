// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_build.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/base/atomic_max.h"
#include "layer/micromaps/micromap.h"
#include "layer/rules/builds.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/driver_builds.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

constexpr VkDeviceSize kGeometryRecordBytes = kGeometryRecordWords * 4;
constexpr VkDeviceSize kTriangleRecordBytes = kTriangleRecordWords * 4;

// Intersection shaders cannot find out whether their geometry is opaque, so the descriptor states it.
void setBoxes(std::array<uint32_t, kDescriptorWords> &descriptor, const StructureBuild &build)
{
    bool alike = true;
    uint32_t opaque = 0;
    for (uint32_t i = 0; i < build.geometryCount(); ++i) {
        alike = alike && build.inputs[i].opaque == build.inputs[0].opaque;
        if (build.inputs[i].opaque)
            opaque |= 1u << i % 32;
    }
    if (!build.hasBoxes || (!alike && build.geometryCount() > 32))
        return;
    descriptor[2] = kDescriptorBoxes;
    descriptor[7] = alike ? (build.inputs[0].opaque ? ~0u : 0) : opaque;
}

// The builds of one command, and the work around the driver's builds.
class Build
{
public:
    Build(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command,
          std::vector<StructureBuild> builds)
        : device_(device), commandBuffer_(commandBuffer), command_(command)
    {
        parts_.reserve(builds.size());
        for (StructureBuild &build : builds)
            parts_.emplace_back(std::move(build));
    }

    void record()
    {
        for (Part &part : parts_)
            prepare(part);
        InjectedWork work(device_.commands, commandBuffer_);
        skipUnrecordable(work);
        patchInstances(work);
        orderDescriptorsAfterBuilds();
        runDriver();
        writeDescriptors();
        writeTails(work);
    }

private:
    // The copies of the application's instances, by transfers, which are faster than a shader that copies them: before
    // the driver's build to what it builds from, and after it to the tail. Null buffers: the shader copies.
    struct InstanceTransfers {
        VkBuffer source = VK_NULL_HANDLE, patched = VK_NULL_HANDLE, structure = VK_NULL_HANDLE;
        VkBufferCopy toPatched{}, toTail{};
    };

    struct Part {
        explicit Part(StructureBuild &&given) : build(std::move(given)) {}
        StructureBuild build;
        VkDeviceAddress sourceDescriptor = 0;
        VkDeviceAddress tail = 0; // of the records of a bottom-level structure; 0: it has none
        VkDeviceSize tailBytes = 0;
        // The size that the driver needs; only set for builds without records, if the driver clears whole handles.
        VkDeviceSize driverBytes = 0;
        StructureDescriptor descriptor;
        RangeInfo instanceRange{}; // of the patched instances
        TlasInstancesPush instances{};
        InstanceTransfers transfers;
        bool skipped = false;

        [[nodiscard]] AccelerationStructure &target() const { return *build.target; }
    };

    void reject(Part &part, const char *id, const std::string &text)
    {
        rejectCommand(device_.driver, command_, part.target().handle, id, text, part.build.element);
        part.skipped = true;
    }

    void prepare(Part &part)
    {
        hideMicromaps(part.build);
        if (part.build.source)
            part.sourceDescriptor = descriptorOf(device_.objects, *part.build.source).address;
        part.descriptor = descriptorOf(device_.objects, part.target());
        if (!part.descriptor.address)
            reject(part, "VELLUM-out-of-memory", "no memory for the layer's tables");
        else if (!part.build.topLevel)
            prepareBottomLevel(part);
    }

    static std::string tooSmall(const Part &part)
    {
        return "dstAccelerationStructure has " + std::to_string(part.target().size) +
               " bytes, less than vkGetAccelerationStructureBuildSizesKHR gives";
    }

    [[nodiscard]] VkDeviceSize driverBytes(StructureBuild &build, const std::vector<uint32_t> &primitives) const
    {
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        device_.driver.next.GetAccelerationStructureBuildSizesKHR(device_.driver.handle,
                                                                  VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                                  &build.driverInfo(), primitives.data(), &sizes);
        return sizes.accelerationStructureSize;
    }

    void prepareBottomLevel(Part &part)
    {
        AccelerationStructure &target = part.target();
        atomicMax(device_.objects.mostGeometries, part.build.geometryCount());
        const std::vector<uint32_t> primitives = part.build.primitives();
        part.tailBytes = bottomLevelTailBytes(part.build, primitives.data());
        if (part.tailBytes == 0 && !device_.driver.clearsWholeHandles)
            return becomes(target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, 0);
        const VkDeviceSize needed = driverBytes(part.build, primitives);
        if (part.tailBytes == 0) {
            part.driverBytes = std::min(alignUp(needed, 16), target.size);
            return fitBottomLevel(part, part.driverBytes);
        }
        VkDeviceSize offset = alignUp(needed, kPartAlignment);
        const VkDeviceSize bytes = offset + part.tailBytes;
        if (part.tailBytes > target.size || (offset + part.tailBytes > target.size && !part.build.source)) {
            reject(part, rules::kTargetSizeId, tooSmall(part));
            return;
        }
        // An update of a compacted structure: the device knows the location of its records; if it has none, they come
        // last.
        if (offset + part.tailBytes > target.size)
            offset = (target.size - part.tailBytes) / kPartAlignment * kPartAlignment;
        part.tail = beginOf(device_.driver, target) + offset;
        fitBottomLevel(part, bytes);
    }

    // Without the shaders for its records a build is skipped: the driver would replace the structure, and its
    // descriptor would still lead to the records of its earlier content.
    void skipUnrecordable(InjectedWork &work)
    {
        for (Part &part : parts_) {
            if (!part.skipped && (part.tail || part.build.topLevel))
                part.skipped = !work.prepare(part.tail ? InjectedShader::BlasRecords : InjectedShader::TlasInstances);
        }
    }

    // Limits the range that the driver may write to what the build needs.
    void fitBottomLevel(Part &part, VkDeviceSize bytes)
    {
        // The source of an update may be compacted, and have fewer bytes.
        const bool known = !part.build.source || device_.driver.clearsWholeHandles;
        becomes(part.target(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                known ? std::min(bytes, part.target().size) : 0);
        fit(part, bytes);
    }
    void fit(Part &part, VkDeviceSize bytes)
    {
        VkAccelerationStructureBuildGeometryInfoKHR &info = part.build.info;
        const VkAccelerationStructureKHR exact = exactSizeHandle(device_, part.target(), bytes);
        if (info.srcAccelerationStructure == info.dstAccelerationStructure)
            info.srcAccelerationStructure = exact;
        info.dstAccelerationStructure = exact;
    }

    // False: the part is skipped.
    bool prepareTopLevel(Part &part)
    {
        StructureBuild &build = part.build;
        AccelerationStructure &target = part.target();
        const uint32_t count = build.ranges.primitives(0);
        const TopLevelLayout layout(device_.driver, build.info.flags, count);
        if (layout.bytes() > target.size) {
            reject(part, rules::kTargetSizeId, tooSmall(part));
            return false;
        }
        const auto slots = slotsFor(device_.objects, target, count);
        if (!slots) {
            reject(part, "VELLUM-out-of-slots",
                   "more than 2^24 instances in all acceleration structures together, or no "
                   "memory for the layer's tables");
            return false;
        }
        device_.commands.states.keep(commandBuffer_, slots->use());
        becomesTopLevel(target, count, layout.bytes());
        fit(part, layout.bytes());
        VkAccelerationStructureGeometryInstancesDataKHR &instances = build.geometries[0].geometry.instances;
        TlasInstancesPush &push = part.instances;
        push.source = instances.data.deviceAddress;
        if (build.ranges.direct)
            push.source += build.ranges.direct[0].primitiveOffset;
        push.range = build.ranges.address(0);
        // After the scratch memory that the driver needs.
        push.target = alignUp(build.info.scratchData.deviceAddress + layout.driverScratch, kPatchedAlignment);
        push.root = device_.objects.root.address();
        push.tail = beginOf(device_.driver, target) + layout.tailOffset;
        push.descriptor = part.descriptor.address;
        push.count = count;
        push.firstSlot = slots->first();
        push.from = instances.arrayOfPointers ? kFromPointers : kFromArray;
        instances.arrayOfPointers = VK_FALSE;
        instances.data.deviceAddress = push.target;
        part.instanceRange = {count, 0, 0, 0};
        prepareTransfers(part, layout.tailOffset);
        return true;
    }

    void prepareTransfers(Part &part, VkDeviceSize tailOffset)
    {
        TlasInstancesPush &push = part.instances;
        const AddressMap &addresses = device_.buffers.addresses;
        const AccelerationStructure &target = part.target();
        const VkDeviceSize bytes = push.count * sizeof(VkAccelerationStructureInstanceKHR);
        const bool hostKnowsRange = push.from == kFromArray && push.range == 0 && bytes > 0;
        if (!hostKnowsRange || (device_.buffers.infos.get(target.buffer).usage & VK_BUFFER_USAGE_TRANSFER_DST_BIT) == 0)
            return;
        const AddressMap::Location source = addresses.covering(push.source, bytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
        const AddressMap::Location patched = addresses.covering(push.target, bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        const auto overlaps = [&](VkDeviceAddress to) { return push.source < to + bytes && to < push.source + bytes; };
        if (!source.buffer || !patched.buffer || overlaps(push.target) || overlaps(push.tail))
            return;
        device_.commands.states.keep(commandBuffer_, source.owner);
        device_.commands.states.keep(commandBuffer_, patched.owner);
        part.transfers = {source.buffer,
                          patched.buffer,
                          target.buffer,
                          {source.offset, patched.offset, bytes},
                          {source.offset, target.offset + tailOffset, bytes}};
        push.source = push.target;
        push.from = kFromTarget;
    }

    void patchInstances(InjectedWork &work)
    {
        bool any = false;
        for (Part &part : parts_) {
            if (!part.skipped && part.build.topLevel)
                any |= prepareTopLevel(part);
        }
        if (!any)
            return;
        work.barrier();
        bool transferred = false;
        for (const Part &part : parts_) {
            const InstanceTransfers &transfers = part.transfers;
            if (!transfers.source)
                continue;
            device_.driver.next.CmdCopyBuffer(commandBuffer_, transfers.source, transfers.patched, 1,
                                              &transfers.toPatched);
            transferred = true;
        }
        if (transferred)
            work.barrier();
        for (Part &part : parts_) {
            if (!part.skipped && part.build.topLevel)
                part.skipped = !work.dispatch(InjectedShader::TlasInstances, part.instances,
                                              std::max(part.instances.count, 1u), 64);
        }
        work.barrier(true); // the host reads the greatest record offset
    }

    [[nodiscard]] static bool writesPlainDescriptor(const Part &part)
    {
        return !part.skipped && !part.build.topLevel && !part.tail;
    }

    // A queue that waits by a semaphore for another queue's build of a structure does so in the build stage. The
    // transfer to the structure's descriptor must also wait for it. Semaphores are waited for before the command buffer
    // begins, so one barrier per command buffer is enough. It is recorded before the first build, so that builds do not
    // wait for each other. (writeDescriptors() orders barriers of one queue. Not ordered: a wait in another stage,
    // followed by a barrier of the application that leads to the build stage.)
    void orderDescriptorsAfterBuilds()
    {
        const auto state = device_.commands.states.get(commandBuffer_);
        if (!state || state->descriptorsWait || std::none_of(parts_.begin(), parts_.end(), writesPlainDescriptor))
            return;
        const VkMemoryBarrier builds{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr,
                                     VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR |
                                         VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                     VK_ACCESS_TRANSFER_WRITE_BIT};
        device_.driver.next.CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                               VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 1, &builds, 0, nullptr, 0, nullptr);
        state->descriptorsWait = true;
    }

    void runDriver()
    {
        DriverBuilds builds;
        for (Part &part : parts_) {
            // A top-level structure is built for the greatest possible number of instances; the rest are inactive.
            if (!part.skipped)
                builds.add(part.build.driverInfo(),
                           part.build.topLevel ? input::BuildRanges{.direct = &part.instanceRange} : part.build.ranges);
        }
        builds.record(device_.driver, commandBuffer_);
    }

    [[nodiscard]] std::array<uint32_t, kDescriptorWords> plainDescriptor(const Part &part) const
    {
        std::array<uint32_t, kDescriptorWords> words{};
        words[2] = kDescriptorPlain;
        setBoxes(words, part.build);
        words[2] |= static_cast<uint32_t>(part.descriptor.address % kDescriptorGenerations)
                    << kDescriptorGenerationShift;
        if (part.driverBytes > 0) {
            const VkDeviceAddress end = beginOf(device_.driver, part.target()) + part.driverBytes;
            std::memcpy(words.data(), &end, sizeof end);
        }
        return words;
    }

    // Writes the descriptors of structures without records: the descriptor of an earlier build must not be found. A
    // shader that accesses a descriptor has full barriers before and after it. In another command buffer only the build
    // stage may follow, by a semaphore or an event, so the barrier orders the descriptors before that stage. Adjacent
    // descriptors, as those of structures that were made one after the other, are written at once.
    void writeDescriptors()
    {
        constexpr size_t kMostUpdatedBytes = 65536; // of vkCmdUpdateBuffer
        std::vector<std::array<uint32_t, kDescriptorWords>> words;
        StructureDescriptor first;
        const auto bytes = [&] { return words.size() * kDescriptorWords * 4; };
        const auto flush = [&] {
            if (!words.empty())
                device_.driver.next.CmdUpdateBuffer(commandBuffer_, first.buffer, first.offset, bytes(), words.data());
            words.clear();
        };
        for (const Part &part : parts_) {
            if (!writesPlainDescriptor(part))
                continue;
            const StructureDescriptor &descriptor = part.descriptor;
            if (descriptor.buffer != first.buffer || descriptor.offset != first.offset + bytes() ||
                bytes() == kMostUpdatedBytes) {
                flush();
                first = descriptor;
            }
            words.push_back(plainDescriptor(part));
        }
        if (!first.buffer)
            return;
        flush();
        const VkMemoryBarrier descriptors{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_TRANSFER_WRITE_BIT,
                                          VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR};
        device_.driver.next.CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                               VK_PIPELINE_STAGE_TRANSFER_BIT |
                                                   VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                               0, 1, &descriptors, 0, nullptr, 0, nullptr);
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
                writeRecords(work, part);
            } else if (const InstanceTransfers &transfers = part.transfers; transfers.source) {
                device_.driver.next.CmdCopyBuffer(commandBuffer_, transfers.source, transfers.structure, 1,
                                                  &transfers.toTail);
            } else {
                part.instances.pass = 1;
                work.dispatch(InjectedShader::TlasInstances, part.instances, part.instances.count, 64);
            }
        }
        work.barrier();
    }

    void writeRecords(InjectedWork &work, const Part &part)
    {
        const StructureBuild &build = part.build;
        const uint32_t geometries = build.geometryCount();
        VkDeviceSize triangles = geometries * (kGeometryRecordBytes + kMicromapNameWords * 4); // offset in the tail
        for (uint32_t g = 0; g < geometries; ++g) {
            BlasRecordsPush push{};
            push.tail = part.tail;
            push.geometryWord = build.inputs[g].opaque ? kGeometryRecordOpaque : 0;
            push.descriptor = g == 0 ? part.descriptor.address : 0;
            push.geometryCount = geometries;
            push.geometry = g;
            push.tailUnits = unitsOf(part.tailBytes);
            if (build.source) {
                push.source = part.sourceDescriptor;
                push.sourceBegin = beginOf(device_.driver, *build.source);
                push.begin = beginOf(device_.driver, part.target());
                push.commonUnits = unitsOf(std::min(build.source->size, part.target().size));
            }
            if (const auto &attachment = build.inputs[g].micromap) {
                push.triangleCount = build.ranges.primitives(g);
                push.range = build.ranges.address(g);
                push.geometryWord |= static_cast<uint32_t>(triangles / kTriangleRecordBytes) << kGeometryTrianglesShift;
                push.micromap = micromapAddress(device_.driver, attachment->micromap);
                push.micromapSize = unitsOf(attachment->micromap.size);
                push.named = attachment->structure != nullptr;
                push.baseTriangle = attachment->given.baseTriangle;
                setIndices(push, attachment->given);
                triangles += alignUp(push.triangleCount * kTriangleRecordBytes, 16);
            }
            work.dispatch(InjectedShader::BlasRecords, push, std::max(push.triangleCount, 1u), 64);
        }
    }

    void setIndices(BlasRecordsPush &push, const input::Attachment &attachment)
    {
        // VUID-...EXT-indexType-10719: UINT16, UINT32 or NONE_KHR; VUID-...KHR-indexType-11570: UINT8 too.
        if (attachment.indexType == VK_INDEX_TYPE_NONE_KHR || attachment.indexBuffer.deviceAddress == 0)
            return;
        push.indices = attachment.indexBuffer.deviceAddress;
        const uint32_t bytes = input::indexBytes(attachment.indexType);
        push.indexBytes = bytes == 0 ? 4 : bytes;
        push.indexStride = static_cast<uint32_t>(attachment.indexStride);
        push.readable = device_.buffers.addresses.elementsFrom(push.indices, push.indexBytes, push.indexStride);
    }

    DeviceStructures &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    std::vector<Part> parts_;
};

} // namespace

void recordStructureBuilds(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command,
                           std::vector<StructureBuild> builds)
{
    Build(device, commandBuffer, command, std::move(builds)).record();
}

} // namespace vellum::layer
