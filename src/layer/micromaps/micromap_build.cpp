// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps on the device, and the commands of VK_EXT_opacity_micromap that create and build them; those of
// VK_KHR_opacity_micromap are in structures/structure_commands.cpp.
#include <algorithm>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include "core/align.h"
#include "core/curve.h"
#include "core/micromap.h"
#include "core/records.h"
#include "layer/base/commands.h"
#include "layer/input/checked.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/builds.h"
#include "layer/rules/creations.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// The limit keeps indices of triangles after the last one below 2^32.
constexpr uint32_t kMostInPlace = uint32_t{1} << 31;

// Level and format of the triangles, as in word 1 of a VkMicromapTriangleEXT, if the usage counts declare the same for
// all of them; 0: they do not, or the states are kept in the records.
uint32_t alikeOf(const MicromapBuild &build)
{
    uint32_t alike = 0;
    for (const VkMicromapUsageEXT &usage : build.usages) {
        const uint32_t word = usage.subdivisionLevel | usage.format << 16;
        if (usage.subdivisionLevel <= kCoarseLevel || (alike != 0 && word != alike))
            return 0;
        alike = word;
    }
    return alike;
}

// Invocations that copy the data of a block of triangles. A GPU has threads to spare, and the data may be large.
uint32_t copiersLog2(const DeviceMicromaps &device, const MicromapExtent &extent)
{
    uint32_t log2 = device.driver.threads != 0 ? 2 : extent.maxLevel < 8 ? 6 : 12;
    while (blocksOf(extent.triangles) << log2 > uint64_t{1} << 31) // shaders number them in 32 bits
        --log2;
    return log2;
}

MicromapPush pushOf(const DeviceMicromaps &device, const MicromapBuild &build)
{
    const MicromapExtent &extent = build.extent;
    MicromapPush push{};
    push.micromap = micromapAddress(device.driver, build.target);
    push.triangleArray = build.triangles.deviceAddress;
    push.data = build.data.deviceAddress;
    push.scratch = alignUp(build.scratch, kBuildScratchAlignment);
    push.triangleArrayStride = static_cast<uint32_t>(build.triangleStride);
    push.triangleCount = static_cast<uint32_t>(extent.triangles);
    push.capacityUnits = static_cast<uint32_t>(extent.units);
    push.partCapacity = static_cast<uint32_t>(extent.parts());
    push.flags = (build.flags & kBuildFlagsMask) | extent.maxLevel << kBuildMaxLevelShift;
    push.readable =
        device.buffers.addresses.elementsFrom(push.triangleArray, sizeof(VkMicromapTriangleEXT), build.triangleStride);
    push.alike = alikeOf(build);
    push.copiersLog2 = copiersLog2(device, extent);
    push.dataBytes =
        static_cast<uint32_t>(std::min<VkDeviceSize>(device.buffers.addresses.bytesFrom(push.data), UINT32_MAX));
    return push;
}

// Push constants of the passes that coarsen the input of a lossy build to scratch memory.
MicromapPush coarseningOf(MicromapPush push, const MicromapExtent &extent)
{
    push.micromap = push.scratch + extent.coarsenedOffset();
    return push;
}

// Push constants of the ordinary passes after them.
MicromapPush coarsenedOf(MicromapPush push, const MicromapExtent &extent)
{
    push.triangleArray = push.scratch + extent.coarsenedOffset();
    push.triangleArrayStride = kLossyEntryBytes;
    push.readable = push.triangleCount;
    push.data = push.triangleArray;
    push.dataBytes = static_cast<uint32_t>(extent.coarsenedBytes());
    push.alike = 0;
    return push;
}

// The copy of the input data, up to the micromap's capacity, to the micromap's data units. A null buffer if the driver
// does not allow the copy.
struct DataCopy {
    VkBuffer from = VK_NULL_HANDLE;
    VkBufferCopy region{};
};

DataCopy dataCopyOf(const DeviceMicromaps &device, VkCommandBuffer commandBuffer, const MicromapBuild &build)
{
    const MicromapExtent &extent = build.extent;
    const VkDeviceAddress from = build.data.deviceAddress;
    const AddressMap::Location source = device.buffers.addresses.find(from, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    if (!source.buffer)
        return {};
    const uint64_t begin = extent.bytes() - extent.units * kDataUnitBytes;
    const uint64_t bytes = std::min(source.bytes, extent.units * kDataUnitBytes);
    // The capacity may exceed the data, so that the copy reaches into the micromap itself:
    // VUID-vkCmdCopyBuffer-pRegions-00117.
    const VkDeviceAddress to = micromapAddress(device.driver, build.target) + begin;
    if (from < to + bytes && to < from + bytes)
        return {};
    device.commands.states.keep(commandBuffer, source.owner);
    return {source.buffer, {source.offset, build.target.offset + begin, bytes}};
}

// One build of a command.
struct OneBuild {
    MicromapPush push{};
    DataCopy copy;
    // If the data may be used in place, one pass checks that and writes all records.
    bool inPlace = false;
    // A triangle may have data behind the micromap's capacity. The passes of micromap_pack.comp are then dispatched
    // indirectly, with arguments in the scratch memory, so that they cost little unless the pass in place starts them.
    bool mayPack = false;
    VkBuffer scratch = VK_NULL_HANDLE;
    VkDeviceSize scratchOffset = 0;
    VkBuffer micromap = VK_NULL_HANDLE;
    VkDeviceSize micromapOffset = 0;

    // Triangles of level 7 and above have more than kPartUnits units.
    [[nodiscard]] bool hasParts() const
    {
        return (push.flags >> kBuildMaxLevelShift & 15) >= 7 && push.partCapacity > 0;
    }
    [[nodiscard]] uint64_t triangles() const { return push.triangleCount; }
    [[nodiscard]] uint64_t parts() const { return hasParts() ? push.partCapacity : 0; }
    // Invocations of a pass of micromap_pack.comp.
    [[nodiscard]] uint64_t packing(uint32_t pass) const
    {
        const uint64_t blocks = blocksOf(triangles());
        return pass == kPackSums ? blocks : pass == kPackScan ? 1 : blocks << push.copiersLog2;
    }
};

// Triangles for each invocation of the pass in place.
uint32_t trianglesPerInvocation(const DeviceMicromaps &device, uint32_t triangles)
{
    // 16384 invocations keep a GPU busy.
    if (device.driver.threads == 0)
        return std::clamp(triangles / 16384, 1u, 64u);
    // A workgroup of 64 takes lavapipe a microsecond, as a thousand triangles do. Four for each of its threads share
    // the work well enough.
    return std::max(triangles / enoughInvocations(device.driver), 1u);
}

// Prepares the pass in place, if the build can use it: the layer must know the buffers of the data and, if the build
// may pack, of the scratch memory.
void prepareInPlace(const DeviceMicromaps &device, VkCommandBuffer commandBuffer, const MicromapBuild &given,
                    OneBuild &build)
{
    MicromapPush &push = build.push;
    if (given.extent.lossy || push.triangleCount == 0 || push.triangleCount > kMostInPlace)
        return;
    const uint64_t capacity = uint64_t{push.capacityUnits} * kDataUnitBytes;
    build.mayPack = given.extent.maxLevel > kCoarseLevel && push.dataBytes > capacity;
    AddressMap::Location location;
    if (build.mayPack) {
        location = device.buffers.addresses.covering(
            push.scratch, kScratchTables * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
        if (!location.buffer || location.offset % 4 != 0)
            return;
    }
    if ((device.buffers.infos.get(given.target.buffer).usage & VK_BUFFER_USAGE_TRANSFER_DST_BIT) == 0)
        return;
    if (given.extent.units > 0) {
        build.copy = dataCopyOf(device, commandBuffer, given);
        if (!build.copy.from)
            return;
    }
    if (build.mayPack)
        device.commands.states.keep(commandBuffer, location.owner);
    const uint64_t bytes = packedBytes(push.alike & 0xffff, static_cast<Format>(push.alike >> 16));
    const uint64_t end = std::min(capacity, uint64_t{push.dataBytes});
    if (push.readable < push.triangleCount || push.triangleArrayStride != sizeof(VkMicromapTriangleEXT) ||
        push.triangleArray % sizeof(VkMicromapTriangleEXT) != 0 || end < bytes)
        push.alike = 0;
    push.lastOffset = static_cast<uint32_t>(end - std::min(end, bytes));
    push.trianglesPerInvocation = trianglesPerInvocation(device, push.triangleCount);
    build.inPlace = true;
    build.scratch = location.buffer;
    build.scratchOffset = location.offset;
}

// The builds of one command, stage by stage: they are not ordered among each other.
class Build
{
public:
    Build(DeviceMicromaps &device, VkCommandBuffer commandBuffer)
        : device_(device), commandBuffer_(commandBuffer), work_(device.commands, commandBuffer)
    {
    }

    void add(const MicromapBuild &given)
    {
        OneBuild build;
        build.micromap = given.target.buffer;
        build.micromapOffset = given.target.offset;
        build.push = pushOf(device_, given);
        if (given.extent.lossy) {
            lossy_.emplace_back().push = coarseningOf(build.push, given.extent);
            build.push = coarsenedOf(build.push, given.extent);
        }
        prepareInPlace(device_, commandBuffer_, given, build);
        builds_.push_back(build);
    }

    // Nothing is recorded if the driver cannot create a pipeline: a part of the passes would leave a micromap that
    // leads to data that was not written.
    void record()
    {
        passes();
        recording_ = prepared_;
        if (recording_)
            passes();
    }

private:
    // Records all passes; or, if not recording_, prepares their pipelines.
    void passes()
    {
        barrier();
        if (!lossy_.empty())
            coarsen();
        for (const OneBuild &build : builds_) {
            if (recording_)
                prepare(build);
        }
        if (any([](const OneBuild &build) { return build.inPlace; }))
            barrier();
        stage(InjectedShader::MicromapInPlace, [](const OneBuild &build) {
            return build.inPlace ? (build.triangles() - 1) / build.push.trianglesPerInvocation + 1 : 0;
        });
        for (uint32_t pass = 0; pass < kPackPasses; ++pass)
            pack(pass);
    }

    void barrier()
    {
        if (recording_)
            work_.barrier();
    }

    void prepare(const OneBuild &build)
    {
        const DeviceTable &next = device_.driver.next;
        if (build.copy.from)
            next.CmdCopyBuffer(commandBuffer_, build.copy.from, build.micromap, 1, &build.copy.region);
        if (!build.inPlace)
            return;
        if (build.mayPack) {
            uint32_t scratch[kScratchTables] = {};
            for (uint32_t pass = 0; pass < kPackPasses; ++pass) {
                const VkDispatchIndirectCommand groups = InjectedWork::groupsOf(build.packing(pass), 64);
                std::memcpy(scratch + kScratchArguments + kArgumentWords + pass * 3, &groups, sizeof groups);
            }
            next.CmdUpdateBuffer(commandBuffer_, build.scratch, build.scratchOffset, sizeof scratch, scratch);
        }
        uint32_t header[kMicromapHeaderWords] = {};
        header[kMicromapHeaderMagic] = kMicromapMagic;
        header[kMicromapHeaderTriangles] = build.push.triangleCount;
        header[kMicromapHeaderFlags] = build.push.flags & kBuildFlagsMask;
        const VkDeviceSize begin = build.micromapOffset;
        next.CmdUpdateBuffer(commandBuffer_, build.micromap, begin, sizeof header, header);
        if (build.triangles() % 2 != 0) {
            const uint32_t padding[kTriangleRecordWords] = {};
            next.CmdUpdateBuffer(commandBuffer_, build.micromap,
                                 begin + sizeof header + build.triangles() * sizeof padding, sizeof padding, padding);
        }
    }

    // Lossy builds are coarsened first: the other stages then read the coarsened micromaps in scratch memory.
    void coarsen()
    {
        builds_.swap(lossy_);
        const auto parts = [](const OneBuild &build) { return build.parts(); };
        const bool anyParts = any([](const OneBuild &build) { return build.hasParts(); });
        stage(InjectedShader::MicromapClear, [](const OneBuild &) { return kScratchCounterWords; });
        stage(InjectedShader::MicromapLossy, [](const OneBuild &build) { return build.triangles(); });
        if (anyParts)
            stage(InjectedShader::MicromapLossyParts, parts, kBuildAnalysing);
        stage(InjectedShader::MicromapLossyChoose,
              [](const OneBuild &build) { return std::max<uint64_t>(build.parts(), 1); });
        if (anyParts)
            stage(InjectedShader::MicromapLossyParts, parts);
        builds_.swap(lossy_);
    }

    template <typename Predicate>
    bool any(Predicate predicate)
    {
        return std::any_of(builds_.begin(), builds_.end(), predicate);
    }

    // Runs one shader for every build, then a barrier. `invocations(build)`: 0 if the build does not need the stage.
    template <typename Invocations>
    void stage(InjectedShader shader, Invocations invocations, uint32_t flags = 0)
    {
        for (const OneBuild &build : builds_) {
            const uint64_t count = invocations(build);
            if (count == 0)
                continue;
            MicromapPush push = build.push;
            push.flags |= flags;
            if (recording_)
                work_.dispatch(shader, push, count, 64);
            else
                prepared_ = prepared_ && work_.prepare(shader);
        }
        barrier();
    }

    // A pass of micromap_pack.comp, which builds in place need only if some triangle cannot use its data in place.
    void pack(uint32_t pass)
    {
        constexpr InjectedShader kShader = InjectedShader::MicromapPack;
        bool some = false;
        for (const OneBuild &build : builds_) {
            const uint64_t count = build.packing(pass);
            if (count == 0 || (build.inPlace && !build.mayPack))
                continue;
            some = true;
            MicromapPush push = build.push;
            push.pack = pass;
            if (!recording_)
                prepared_ = prepared_ && work_.prepare(kShader);
            else if (build.inPlace)
                work_.dispatchIndirect(kShader, push, build.scratch,
                                       build.scratchOffset + (kScratchArguments + pass * 3) * 4);
            else
                work_.dispatch(kShader, push, count, 64);
        }
        if (some)
            barrier();
    }

    DeviceMicromaps &device_;
    VkCommandBuffer commandBuffer_;
    InjectedWork work_;
    std::vector<OneBuild> builds_;
    std::vector<OneBuild> lossy_; // for the passes that coarsen
    bool recording_ = false;
    bool prepared_ = true; // all pipelines until now
};

} // namespace

void recordMicromapBuilds(DeviceMicromaps &device, VkCommandBuffer commandBuffer, std::span<const MicromapBuild> builds)
{
    if (builds.empty())
        return;
    Build recording(device, commandBuffer);
    for (const MicromapBuild &build : builds) {
        recording.add(build);
        recordMicromapBound(device, build.target, {build.extent.triangles, build.extent.bytes()});
    }
    recording.record();
}

void getMicromapBuildSizes(DeviceMicromaps &device, VkDevice, VkAccelerationStructureBuildTypeKHR type,
                           const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    sizes->discardable = VK_FALSE;
    sizes->micromapSize = 0;
    sizes->buildScratchSize = 0;
    const auto query = input::Checked<input::Builds>::take(info, [&] {
        input::Builds parsed = input::parse(1, info, type == VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR);
        rules::checkSizes(device.objects.rules, Place("vkGetMicromapBuildSizesEXT"), parsed);
        return parsed;
    });
    const input::MicromapBuild &build = query.micromaps[0];
    if (!build.accepted)
        return;
    sizes->micromapSize = build.needs.micromap;
    sizes->buildScratchSize = build.needs.scratch;
}

void cmdBuildMicromaps(DeviceMicromaps &device, VkCommandBuffer commandBuffer, uint32_t count,
                       const VkMicromapBuildInfoEXT *infos)
{
    constexpr const char *kCommand = "vkCmdBuildMicromapsEXT";
    if (InjectedWork::rejectedIn(device.commands, commandBuffer, kCommand))
        return;
    const auto builds = input::Checked<input::Builds>::take(infos, [&] {
        input::Builds parsed = input::parse(count, infos);
        rules::checkBuilds(device.objects.rules, Place(kCommand), parsed, micromapFacts);
        return parsed;
    });
    std::vector<MicromapBuild> accepted;
    for (const input::MicromapBuild &given : builds.micromaps) {
        if (given.accepted)
            accepted.emplace_back(micromapBuildOf(given)).target = *micromapOf(infos[given.element].dstMicromap);
    }
    recordMicromapBuilds(device, commandBuffer, accepted);
}

VkResult createMicromap(DeviceMicromaps &device, VkDevice, const VkMicromapCreateInfoEXT *info,
                        const VkAllocationCallbacks *, VkMicromapEXT *micromap)
{
    const VkDeviceSize bufferSize = device.buffers.infos.get(info->buffer).size;
    const auto creation = input::Checked<input::Creation>::take(info, [&] {
        const Place command("vkCreateMicromapEXT");
        const Place place = command.member("pCreateInfo");
        return rules::checkCreation(InputCheck(device.objects.rules, place, info->buffer), *info, bufferSize);
    });
    if (!creation.accepted)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const bool replayable = creation.replays && device.driver.enabled.captureReplay;
    // The address of a micromap follows from that of its buffer, which the driver replays.
    if (replayable && info->deviceAddress != 0 &&
        info->deviceAddress != device.driver.bufferAddress(info->buffer) + info->offset) {
        device.driver.report().error(
            "VELLUM-micromap-replay",
            "vkCreateMicromapEXT: the buffer is not at the address that it had at the time of capture");
        return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    auto *object = new (std::nothrow)
        Micromap{info->buffer, info->offset, std::min(info->size, bufferSize - std::min(info->offset, bufferSize)), {}};
    if (!object)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    *micromap = reinterpret_cast<VkMicromapEXT>(object);
    object->object.handle = reinterpret_cast<uint64_t>(*micromap);
    return VK_SUCCESS;
}

void destroyMicromap(DeviceMicromaps &device, VkDevice, VkMicromapEXT micromap, const VkAllocationCallbacks *)
{
    if (micromap) {
        device.objects.privateData.forgetObject(reinterpret_cast<uint64_t>(micromap));
        device.driver.report().setName(reinterpret_cast<uint64_t>(micromap), "");
    }
    delete micromapOf(micromap);
}

} // namespace vellum::layer
