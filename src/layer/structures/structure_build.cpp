// SPDX-License-Identifier: Apache-2.0
// Builds and updates of acceleration structures with emulated micromaps: the driver's builds, the instances that it
// builds from, and the records behind its structures.
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/builds.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_input.h"
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
    // Of a top-level structure.
    struct Instances {
        std::shared_ptr<SlotRange> slots;
        uint32_t count = 0;
        InstanceSource from = InstanceSource::Build;
        VkDeviceAddress source = 0;           // of tlas_instances.comp
        VkDeviceAddress tail = 0;             // its target
        std::optional<TlasGatherPush> gather; // brings them to the tail before
    };

    struct Part {
        explicit Part(StructureBuild &&given) : build(std::move(given)) {}
        StructureBuild build;
        VkDeviceAddress sourceDescriptor = 0;
        VkDeviceAddress tail = 0; // of the records of a bottom-level structure; 0: it has none
        VkDeviceSize tailBytes = 0;
        VkDeviceSize bytes = 0; // with records: what the structure needs
        // The size that the driver needs; only set for builds without records, if the driver clears whole handles.
        VkDeviceSize driverBytes = 0;
        StructureDescriptor descriptor;
        Instances instances;
        RangeInfo instanceRange{}; // of the instances in the tail
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
        part.bytes = bytes;
        fitBottomLevel(part, bytes);
    }

    // Without the shaders for its records a build is skipped: the driver would replace the structure, and its
    // descriptor would still lead to the records of its earlier content.
    void skipUnrecordable(InjectedWork &work)
    {
        for (Part &part : parts_) {
            if (!part.skipped && part.build.topLevel)
                part.skipped = (gathers(part.build) && !work.prepare(InjectedShader::TlasGather)) ||
                               !work.prepare(InjectedShader::TlasInstances);
            else if (!part.skipped && part.tail)
                part.skipped = !work.prepare(InjectedShader::BlasRecords);
        }
    }

    // Whether only the device knows where the instances are, or how many.
    [[nodiscard]] static bool gathers(const StructureBuild &build)
    {
        return build.geometries[0].geometry.instances.arrayOfPointers || build.ranges.address(0) != 0;
    }

    // Limits the range that the driver may write to what the build needs.
    void fitBottomLevel(Part &part, VkDeviceSize bytes)
    {
        const VkAccelerationStructureKHR exact = exactHandle(part, bytes);
        if (!exact)
            return;
        // The source of an update may be compacted, and have fewer bytes.
        const bool known = !part.build.source || device_.driver.clearsWholeHandles;
        becomes(part.target(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                known ? std::min(bytes, part.target().size) : 0);
        buildInto(part, exact);
    }
    // A handle to that many bytes of the target. Null: the part is rejected.
    VkAccelerationStructureKHR exactHandle(Part &part, VkDeviceSize bytes)
    {
        const VkAccelerationStructureKHR exact = exactSizeHandleOrNull(device_, part.target(), bytes);
        if (!exact)
            reject(part, "VELLUM-out-of-memory", "the driver has no memory for a handle to what it builds");
        return exact;
    }
    static void buildInto(Part &part, VkAccelerationStructureKHR exact)
    {
        VkAccelerationStructureBuildGeometryInfoKHR &info = part.build.info;
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
        const VkAccelerationStructureKHR exact = exactHandle(part, layout.tailOffset);
        if (!exact)
            return false;
        device_.commands.states.keep(commandBuffer_, slots->use());
        becomesTopLevel(target, count, layout.tailOffset);
        buildInto(part, exact);
        part.instances.slots = slots;
        part.instances.count = count;
        part.instances.tail = beginOf(device_.driver, target) + layout.tailOffset;
        part.instanceRange = {count, 0, 0, 0};
        prepareInstances(part);
        VkAccelerationStructureGeometryInstancesDataKHR &data = build.geometries[0].geometry.instances;
        data.arrayOfPointers = VK_FALSE;
        data.data.deviceAddress = part.instances.tail;
        return true;
    }

    void prepareInstances(Part &part)
    {
        const StructureBuild &build = part.build;
        const VkAccelerationStructureGeometryInstancesDataKHR &data = build.geometries[0].geometry.instances;
        Instances &instances = part.instances;
        instances.source = data.data.deviceAddress;
        if (build.ranges.direct)
            instances.source += build.ranges.direct[0].primitiveOffset;
        if (!gathers(build))
            return;
        TlasGatherPush &push = instances.gather.emplace();
        push.source = instances.source;
        push.root = device_.objects.root.address();
        push.tail = instances.tail;
        push.descriptor = part.descriptor.address;
        push.range = build.ranges.address(0);
        push.count = instances.count;
        push.firstSlot = instances.slots->first();
        push.from = data.arrayOfPointers ? kFromPointers : kFromArray;
        instances.source = instances.tail;
        instances.from = push.range != 0 ? InstanceSource::IndirectBuild : InstanceSource::Build;
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
        bool gathered = false;
        for (Part &part : parts_) {
            if (part.skipped || !part.build.topLevel)
                continue;
            const Instances &instances = part.instances;
            if (!instances.gather)
                continue;
            part.skipped =
                !work.dispatch(InjectedShader::TlasGather, *instances.gather, std::max(instances.count, 1u), 64);
            gathered = true;
        }
        if (gathered)
            work.barrier();
        for (Part &part : parts_) {
            const Instances &instances = part.instances;
            if (!part.skipped && part.build.topLevel)
                part.skipped = !layer::patchInstances(work, device_, *instances.slots, instances.count,
                                                      instances.source, instances.tail, instances.from);
        }
        for (const Part &part : parts_) {
            if (part.skipped || !part.build.topLevel || part.instances.gather)
                continue;
            const auto words = topLevelDescriptor(part);
            device_.driver.next.CmdUpdateBuffer(commandBuffer_, part.descriptor.buffer, part.descriptor.offset,
                                                sizeof words, words.data());
        }
        work.barrier(true); // the host reads the descriptors and the greatest record offset
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

    // Word 2 of the descriptor that the part is written to.
    static uint32_t kindWord(const Part &part, uint32_t kind)
    {
        return kind | static_cast<uint32_t>(part.descriptor.address % kDescriptorGenerations)
                          << kDescriptorGenerationShift;
    }

    static std::array<uint32_t, kDescriptorWords> topLevelDescriptor(const Part &part)
    {
        const Instances &instances = part.instances;
        const uint32_t units = instances.count * kInstanceUnits;
        std::array<uint32_t, kDescriptorWords> words{
            0, 0, kindWord(part, kDescriptorTop), units, instances.count, units, instances.slots->first(), 0};
        std::memcpy(words.data(), &instances.tail, sizeof instances.tail);
        return words;
    }

    [[nodiscard]] std::array<uint32_t, kDescriptorWords> plainDescriptor(const Part &part) const
    {
        std::array<uint32_t, kDescriptorWords> words{};
        words[2] = kDescriptorPlain;
        setBoxes(words, part.build);
        words[2] = kindWord(part, words[2]);
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
        const auto hasTail = [](const Part &p) { return !p.skipped && p.tail; };
        if (std::none_of(parts_.begin(), parts_.end(), hasTail))
            return;
        work.barrier();
        for (const Part &part : parts_) {
            if (hasTail(part))
                writeRecords(work, part);
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
                // A GENERIC handle may be larger than what belongs to the structure.
                const VkDeviceSize own = build.source == build.target ? part.target().size : part.bytes;
                push.commonUnits = unitsOf(std::min({build.source->size, part.target().size, own}));
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

void EmulatedBackend::record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds)
{
    Build(device_, commandBuffer, command, std::move(builds)).record();
}

} // namespace vellum::layer
