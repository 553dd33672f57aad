#include "layer/micromap_build.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "core/curve.h"
#include "core/micromap.h"
#include "core/records.h"
#include "layer/device.h"
#include "layer/micromap.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// The build's shaders count in 32 bits, and add the units of a block to a sum that may have reached the limit.
constexpr uint64_t kMostTriangles = UINT32_MAX;
constexpr uint64_t kMostUnits = UINT32_MAX - (uint64_t{kPlaceBlock} << 18);
// Above it, tables for sharing would have to be addressed in 64 bits.
constexpr uint64_t kMostSharing = uint64_t{1} << 26;

const VkMicromapUsageEXT &usageAt(const VkMicromapBuildInfoEXT &info, uint32_t i)
{
    return info.pUsageCounts ? info.pUsageCounts[i] : *info.ppUsageCounts[i];
}

constexpr uint64_t blocksOf(uint64_t triangles)
{
    return (triangles + kPlaceBlock - 1) / kPlaceBlock;
}

std::optional<Offence> deviceOffenceOf(const Device &device, const VkMicromapBuildInfoEXT &info)
{
    if (auto offence = buildOffenceOf(info))
        return offence;
    const MicromapExtent extent = extentOf(info);
    if (extent.triangles == 0)
        return std::nullopt;
    if (info.triangleArray.deviceAddress == 0 || info.data.deviceAddress == 0)
        return Offence{info.data.deviceAddress == 0 ? "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-10896"
                                                    : "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-10897",
                       "data or triangleArray is a null address"};
    if (info.scratchData.deviceAddress == 0)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07512", "scratchData is a null address"};
    if (info.scratchData.deviceAddress % 16 != 0)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07514", "scratchData is not aligned"};
    const uint64_t scratch = device.addresses.bytesFrom(info.scratchData.deviceAddress);
    if (scratch < extent.scratchBytes())
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07509", "scratchData has " + std::to_string(scratch) +
                                                                              " bytes in its buffer, the build needs " +
                                                                              std::to_string(extent.scratchBytes())};
    return std::nullopt;
}

MicromapPush pushOf(const Device &device, const VkMicromapBuildInfoEXT &info)
{
    const MicromapExtent extent = extentOf(info);
    MicromapPush push{};
    push.micromap = micromapAddress(device, info.dstMicromap);
    push.triangleArray = info.triangleArray.deviceAddress;
    push.data = info.data.deviceAddress;
    push.scratch = info.scratchData.deviceAddress;
    push.log = device.complaints.address();
    push.object = complaintObject(info.dstMicromap);
    push.triangleArrayStride = static_cast<uint32_t>(info.triangleArrayStride);
    push.triangleCount = static_cast<uint32_t>(extent.triangles);
    push.capacityUnits = static_cast<uint32_t>(extent.units);
    push.partCapacity = static_cast<uint32_t>(extent.parts());
    push.tableMask = static_cast<uint32_t>(extent.tableSlots() - 1);
    push.flags =
        (info.flags & kBuildFlagsMask) | extent.maxLevel << kBuildMaxLevelShift | (extent.share ? kBuildShare : 0);
    const VkDeviceSize arrayBytes = device.addresses.bytesFrom(push.triangleArray);
    const VkDeviceSize size = sizeof(VkMicromapTriangleEXT);
    const VkDeviceSize stride = std::max<VkDeviceSize>(info.triangleArrayStride, 1);
    const VkDeviceSize readable = arrayBytes < size ? 0 : (arrayBytes - size) / stride + 1;
    push.readable = static_cast<uint32_t>(std::min<VkDeviceSize>(readable, UINT32_MAX));
    push.dataBytes = static_cast<uint32_t>(std::min<VkDeviceSize>(device.addresses.bytesFrom(push.data), UINT32_MAX));
    return push;
}

// The data as it lies, as much as there is room for, to be copied to where a micromap's data goes. Nothing where the
// build shares data, or the driver would not let it be copied.
struct DataCopy {
    VkBuffer from = VK_NULL_HANDLE;
    VkBuffer to = VK_NULL_HANDLE;
    VkBufferCopy region{};
};

DataCopy dataCopyOf(const Device &device, const VkMicromapBuildInfoEXT &info)
{
    const MicromapExtent extent = extentOf(info);
    if (extent.share || extent.units == 0)
        return {};
    const AddressMap::Place source = device.addresses.find(info.data.deviceAddress);
    if (!source.buffer || (device.buffers.get(source.buffer).usage & VK_BUFFER_USAGE_TRANSFER_SRC_BIT) == 0)
        return {};
    const Micromap &target = *micromapOf(info.dstMicromap);
    const uint64_t begin = extent.bytes() - extent.units * kDataUnitBytes;
    const uint64_t bytes = std::min(source.bytes, extent.units * kDataUnitBytes);
    // As much as there is room for may reach from the data into the micromap: VUID-vkCmdCopyBuffer-pRegions-00117.
    const VkDeviceAddress from = info.data.deviceAddress, to = micromapAddress(device, target) + begin;
    if (from < to + bytes && to < from + bytes)
        return {};
    return {source.buffer, target.buffer, {source.offset, target.offset + begin, bytes}};
}

// One vkCmdBuildMicromapsEXT, stage by stage: builds of one command are not ordered among each other.
class Build
{
public:
    Build(Device &device, VkCommandBuffer commandBuffer)
        : device_(device), commandBuffer_(commandBuffer), work_(device, commandBuffer)
    {
    }

    void add(const VkMicromapBuildInfoEXT &info)
    {
        copies_.push_back(dataCopyOf(device_, info));
        pushes_.push_back(pushOf(device_, info));
        if (copies_.back().from)
            pushes_.back().flags |= kBuildVerbatim;
    }

    void record()
    {
        const bool share = any([](const MicromapPush &push) { return shares(push); });
        const bool parts = any([](const MicromapPush &push) { return hasParts(push); });
        work_.barrier();
        for (const DataCopy &copy : copies_) {
            if (copy.from)
                device_.next.CmdCopyBuffer(commandBuffer_, copy.from, copy.to, 1, &copy.region);
        }
        stage(InjectedShader::MicromapClear, [](const MicromapPush &push) {
            return push.triangleCount == 0 ? 0 : std::max<uint64_t>(push.tableMask + uint64_t{1}, kScratchCounterWords);
        });
        if (share)
            analyse(parts);
        if (any([](const MicromapPush &push) { return (push.flags & kBuildVerbatim) != 0; }))
            stage(InjectedShader::MicromapCheck, [](const MicromapPush &push) {
                const uint64_t runs =
                    (uint64_t{push.triangleCount} + kCheckedPerInvocation - 1) / kCheckedPerInvocation;
                return (push.flags & kBuildVerbatim) != 0 ? runs : 0;
            });
        stage(InjectedShader::MicromapSums, [](const MicromapPush &push) { return blockInvocations(push); });
        stage(
            InjectedShader::MicromapScan, [](const MicromapPush &) { return 1; }, 1);
        stage(InjectedShader::MicromapPlace, [](const MicromapPush &push) { return blockInvocations(push); });
        if (parts) {
            stage(InjectedShader::MicromapParts, partInvocations);
            stage(InjectedShader::MicromapFold,
                  [](const MicromapPush &push) { return shares(push) ? 0 : partInvocations(push); });
        }
        if (share)
            stage(InjectedShader::MicromapOwners, sharedTriangles);
    }

private:
    static bool shares(const MicromapPush &push) { return (push.flags & kBuildShare) != 0; }
    // More than kPartUnits units is what triangles of level 7 and above have.
    static bool hasParts(const MicromapPush &push)
    {
        return (push.flags >> kBuildMaxLevelShift & 15) >= 7 && push.partCapacity > 0;
    }
    static uint64_t blockInvocations(const MicromapPush &push) { return blocksOf(push.triangleCount) * 64; }
    static uint64_t partInvocations(const MicromapPush &push) { return hasParts(push) ? push.partCapacity : 0; }
    static uint64_t sharedTriangles(const MicromapPush &push) { return shares(push) ? push.triangleCount : 0; }

    void analyse(bool parts)
    {
        stage(InjectedShader::MicromapAnalyse, sharedTriangles, 64, kBuildAnalysing);
        if (parts)
            stage(
                InjectedShader::MicromapParts,
                [](const MicromapPush &push) { return shares(push) ? partInvocations(push) : 0; }, 64, kBuildAnalysing);
        stage(InjectedShader::MicromapShare, sharedTriangles);
    }

    template <typename Predicate>
    bool any(Predicate predicate)
    {
        return std::any_of(pushes_.begin(), pushes_.end(), predicate);
    }

    // One shader for every build, then a barrier. `invocations(push)`: 0 where the build does not need the stage.
    template <typename Invocations>
    void stage(InjectedShader shader, Invocations invocations, uint32_t groupSize = 64, uint32_t flags = 0)
    {
        for (MicromapPush push : pushes_) {
            const uint64_t count = invocations(push);
            if (count == 0)
                continue;
            push.flags |= flags;
            work_.dispatch(shader, push, count, groupSize);
        }
        work_.barrier();
    }

    Device &device_;
    VkCommandBuffer commandBuffer_;
    InjectedWork work_;
    std::vector<MicromapPush> pushes_;
    std::vector<DataCopy> copies_;
};

} // namespace

uint64_t MicromapExtent::bytes() const
{
    return kMicromapHeaderWords * 4 + (triangles + 1) / 2 * 16 + units * kDataUnitBytes;
}

uint64_t MicromapExtent::parts() const
{
    return units / kPartUnits;
}

uint64_t MicromapExtent::tableSlots() const
{
    return share ? std::bit_ceil(std::max<uint64_t>(2 * triangles, 2)) : 1;
}

uint64_t MicromapExtent::scratchBytes() const
{
    uint64_t words = kScratchCounterWords + blocksOf(triangles) + 2 * parts();
    if (share)
        words += 2 * triangles + tableSlots();
    return (words * 4 + 255) / 256 * 256;
}

MicromapExtent extentOf(const VkMicromapBuildInfoEXT &info)
{
    MicromapExtent extent;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = usageAt(info, i);
        extent.triangles += usage.count;
        if (usage.count > 0)
            extent.maxLevel = std::max(extent.maxLevel, usage.subdivisionLevel);
        // States of up to level 2 are kept in the triangle record itself.
        if (usage.subdivisionLevel > kCoarseLevel) {
            const uint64_t bytes = packedBytes(usage.subdivisionLevel, static_cast<Format>(usage.format));
            extent.units += usage.count * ((bytes + kDataUnitBytes - 1) / kDataUnitBytes);
        }
    }
    // Sharing reads all data twice more. It makes compaction worth while, and denser data is faster to trace.
    const VkBuildMicromapFlagsEXT wanted =
        VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT | VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
    extent.share = (info.flags & wanted) != 0 && (info.flags & VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT) == 0 &&
                   extent.triangles > 0 && extent.triangles <= kMostSharing;
    return extent;
}

std::optional<Offence> offenceOf(const VkMicromapBuildInfoEXT &info)
{
    if (info.type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT)
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-type-parameter",
                       "type " + std::to_string(info.type) + " is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT"};
    if (info.mode != VK_BUILD_MICROMAP_MODE_BUILD_EXT)
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-mode-parameter",
                       "mode " + std::to_string(info.mode) + " is not VK_BUILD_MICROMAP_MODE_BUILD_EXT"};
    if (info.usageCountsCount > 0 && (info.pUsageCounts != nullptr) == (info.ppUsageCounts != nullptr))
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516",
                       info.pUsageCounts
                           ? "both pUsageCounts and ppUsageCounts are given"
                           : "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given"};
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = usageAt(info, i);
        const std::string where = "usage count " + std::to_string(i) + ": ";
        if (usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT &&
            usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT)
            return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-format-11652",
                           where + "format " + std::to_string(usage.format) + " is neither 2-state nor 4-state"};
        if (usage.subdivisionLevel > kMaxSubdivisionLevel)
            return Offence{usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT
                               ? "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654"
                               : "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655",
                           where + "subdivision level " + std::to_string(usage.subdivisionLevel) + " is above 12"};
    }
    const MicromapExtent extent = extentOf(info);
    if (extent.triangles >= kMostTriangles || extent.units >= kMostUnits)
        return Offence{"VELLUM-micromap-too-large",
                       "the usage counts add up to more than 2^32 triangles or data units"};
    return std::nullopt;
}

std::optional<Offence> buildOffenceOf(const VkMicromapBuildInfoEXT &info)
{
    if (auto offence = offenceOf(info))
        return offence;
    const Micromap *destination = micromapOf(info.dstMicromap);
    if (!destination)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstMicromap is VK_NULL_HANDLE"};
    const MicromapExtent extent = extentOf(info);
    const uint64_t needed = extent.bytes();
    if (destination->size < needed)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07461",
                       "dstMicromap has " + std::to_string(destination->size) + " bytes, the build needs " +
                           std::to_string(needed)};
    if (extent.triangles == 0)
        return std::nullopt;
    if (info.triangleArrayStride > UINT32_MAX)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits"};
    // A stride of less than a triangle would still be read safely, but means a mistake.
    if (info.triangleArrayStride < sizeof(VkMicromapTriangleEXT) && extent.triangles > 1)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride " + std::to_string(info.triangleArrayStride) +
                                                     " is less than the 8 bytes of a VkMicromapTriangleEXT"};
    return std::nullopt;
}

void recordMicromapBuilds(Device &device, VkCommandBuffer commandBuffer,
                          const std::vector<const VkMicromapBuildInfoEXT *> &infos)
{
    if (infos.empty())
        return;
    Build build(device, commandBuffer);
    for (const VkMicromapBuildInfoEXT *info : infos)
        build.add(*info);
    build.record();
}

VKAPI_ATTR void VKAPI_CALL getMicromapBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                                 const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    sizes->discardable = VK_FALSE;
    if (const auto offence = offenceOf(*info)) {
        deviceOf(handle).report().error(offence->id, "vkGetMicromapBuildSizesEXT: " + offence->text);
        sizes->micromapSize = 0;
        sizes->buildScratchSize = 0;
        return;
    }
    const MicromapExtent extent = extentOf(*info);
    sizes->micromapSize = (extent.bytes() + 255) / 256 * 256;
    // The host has memory of its own.
    sizes->buildScratchSize = type == VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR ? 0 : extent.scratchBytes();
}

VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer commandBuffer, uint32_t count,
                                             const VkMicromapBuildInfoEXT *infos)
{
    Device &device = deviceOf(commandBuffer);
    if (InjectedWork::refusedIn(device, commandBuffer, "vkCmdBuildMicromapsEXT"))
        return;
    std::vector<const VkMicromapBuildInfoEXT *> good;
    for (uint32_t i = 0; i < count; ++i) {
        if (const auto offence = deviceOffenceOf(device, infos[i])) {
            device.report().error(offence->id,
                                  "vkCmdBuildMicromapsEXT: pInfos[" + std::to_string(i) + "]: " + offence->text,
                                  VK_OBJECT_TYPE_MICROMAP_EXT, reinterpret_cast<uint64_t>(infos[i].dstMicromap));
            continue;
        }
        good.push_back(&infos[i]);
    }
    recordMicromapBuilds(device, commandBuffer, good);
}

} // namespace vellum::layer
