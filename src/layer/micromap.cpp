#include "layer/micromap.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "core/curve.h"
#include "core/micromap.h"
#include "core/records.h"
#include "layer/device.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

Micromap *fromHandle(VkMicromapEXT handle)
{
    return reinterpret_cast<Micromap *>(handle);
}

const VkMicromapUsageEXT &usageAt(const VkMicromapBuildInfoEXT &info, uint32_t i)
{
    return info.pUsageCounts ? info.pUsageCounts[i] : *info.ppUsageCounts[i];
}

// What a micromap of these usage counts takes.
struct Extent {
    uint64_t triangles = 0;
    uint64_t units = 0; // of kDataUnitBytes
    [[nodiscard]] uint64_t dataOffset() const { return kMicromapHeaderWords * 4 + (triangles + 1) / 2 * 16; }
    [[nodiscard]] uint64_t bytes() const { return dataOffset() + units * kDataUnitBytes; }
};

Extent extentOf(const VkMicromapBuildInfoEXT &info)
{
    Extent extent;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = usageAt(info, i);
        extent.triangles += usage.count;
        // States of up to level 2 are kept in the triangle record itself.
        if (usage.subdivisionLevel > kCoarseLevel) {
            const uint64_t bytes = packedBytes(usage.subdivisionLevel, static_cast<Format>(usage.format));
            extent.units += usage.count * ((bytes + kDataUnitBytes - 1) / kDataUnitBytes);
        }
    }
    return extent;
}

struct Offence {
    const char *id;
    std::string text;
};

// The first rule that the usage counts and the type break.
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
    const Extent extent = extentOf(info);
    if (extent.triangles > UINT32_MAX || extent.units >= UINT32_MAX)
        return Offence{"VELLUM-micromap-too-large",
                       "the usage counts add up to more than 2^32 triangles or data units"};
    return std::nullopt;
}

std::optional<Offence> buildOffenceOf(const VkMicromapBuildInfoEXT &info)
{
    if (auto offence = offenceOf(info))
        return offence;
    const Micromap *destination = fromHandle(info.dstMicromap);
    if (!destination)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstMicromap is VK_NULL_HANDLE"};
    const Extent extent = extentOf(info);
    const uint64_t needed = extent.bytes();
    if (destination->size < needed)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07461",
                       "dstMicromap has " + std::to_string(destination->size) + " bytes, the build needs " +
                           std::to_string(needed)};
    if (extent.triangles == 0)
        return std::nullopt;
    if (info.triangleArray.deviceAddress == 0 || info.data.deviceAddress == 0)
        return Offence{info.data.deviceAddress == 0 ? "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-10896"
                                                    : "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-10897",
                       "data or triangleArray is a null address"};
    if (info.triangleArrayStride > UINT32_MAX)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits"};
    // A stride of less than a triangle would still be read safely, but means a mistake.
    if (info.triangleArrayStride < sizeof(VkMicromapTriangleEXT) && extent.triangles > 1)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride " + std::to_string(info.triangleArrayStride) +
                                                     " is less than the 8 bytes of a VkMicromapTriangleEXT"};
    return std::nullopt;
}

MicromapPush pushOf(const Device &device, const VkMicromapBuildInfoEXT &info)
{
    const Extent extent = extentOf(info);
    MicromapPush push{};
    push.micromap = micromapAddress(device, info.dstMicromap);
    push.triangleArray = info.triangleArray.deviceAddress;
    push.data = info.data.deviceAddress;
    push.triangleArrayStride = static_cast<uint32_t>(info.triangleArrayStride);
    push.triangleCount = static_cast<uint32_t>(extent.triangles);
    push.capacityUnits = static_cast<uint32_t>(extent.units);
    const VkDeviceSize arrayBytes = device.addresses.bytesFrom(push.triangleArray);
    const VkDeviceSize size = sizeof(VkMicromapTriangleEXT);
    const VkDeviceSize stride = std::max<VkDeviceSize>(info.triangleArrayStride, 1);
    const VkDeviceSize readable = arrayBytes < size ? 0 : (arrayBytes - size) / stride + 1;
    push.readable = static_cast<uint32_t>(std::min<VkDeviceSize>(readable, UINT32_MAX));
    push.dataBytes = static_cast<uint32_t>(std::min<VkDeviceSize>(device.addresses.bytesFrom(push.data), UINT32_MAX));
    return push;
}

} // namespace

VkDeviceAddress micromapAddress(const Device &device, VkMicromapEXT handle)
{
    const Micromap *micromap = fromHandle(handle);
    return micromap ? device.bufferAddress(micromap->buffer) + micromap->offset : 0;
}

VKAPI_ATTR VkResult VKAPI_CALL createMicromap(VkDevice handle, const VkMicromapCreateInfoEXT *info,
                                              const VkAllocationCallbacks *, VkMicromapEXT *micromap)
{
    Device &device = deviceOf(handle);
    if (info->type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT) {
        device.report().error("VELLUM-VUID-VkMicromapCreateInfoEXT-type-parameter",
                              "vkCreateMicromapEXT: type is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    if (info->createFlags != 0 || info->deviceAddress != 0) {
        device.report().error(
            "VELLUM-VUID-vkCreateMicromapEXT-deviceAddress-07430",
            "vkCreateMicromapEXT: capture and replay of addresses needs the feature micromapCaptureReplay, "
            "which this device does not have");
        return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    const BufferInfo buffer = device.buffers.get(info->buffer);
    if (info->offset > buffer.size || info->size > buffer.size - info->offset) {
        device.report().error("VELLUM-VUID-VkMicromapCreateInfoEXT-offset-07433",
                              "vkCreateMicromapEXT: offset " + std::to_string(info->offset) + " + size " +
                                  std::to_string(info->size) + " is beyond the buffer's " +
                                  std::to_string(buffer.size) + " bytes");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    if (info->offset % 256 != 0) {
        device.report().error("VELLUM-VUID-VkMicromapCreateInfoEXT-offset-07434", "vkCreateMicromapEXT: offset " +
                                                                                      std::to_string(info->offset) +
                                                                                      " is not a multiple of 256");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    auto *object = new (std::nothrow) Micromap{info->buffer, info->offset, info->size};
    if (!object)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    *micromap = reinterpret_cast<VkMicromapEXT>(object);
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyMicromap(VkDevice handle, VkMicromapEXT micromap, const VkAllocationCallbacks *)
{
    if (micromap)
        deviceOf(handle).privateData.forgetObject(reinterpret_cast<uint64_t>(micromap));
    delete fromHandle(micromap);
}

VKAPI_ATTR void VKAPI_CALL getMicromapBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR,
                                                 const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    sizes->discardable = VK_FALSE;
    if (const auto offence = offenceOf(*info)) {
        deviceOf(handle).report().error(offence->id, "vkGetMicromapBuildSizesEXT: " + offence->text);
        sizes->micromapSize = 0;
        sizes->buildScratchSize = 0;
        return;
    }
    sizes->micromapSize = (extentOf(*info).bytes() + 255) / 256 * 256;
    // The build needs none, but applications make a buffer of this size, and none has 0 bytes.
    sizes->buildScratchSize = 256;
}

VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer commandBuffer, uint32_t count,
                                             const VkMicromapBuildInfoEXT *infos)
{
    Device &device = deviceOf(commandBuffer);
    if (InjectedWork::refusedIn(device, commandBuffer, "vkCmdBuildMicromapsEXT"))
        return;
    std::vector<MicromapPush> pushes;
    for (uint32_t i = 0; i < count; ++i) {
        if (const auto offence = buildOffenceOf(infos[i])) {
            device.report().error(offence->id,
                                  "vkCmdBuildMicromapsEXT: pInfos[" + std::to_string(i) + "]: " + offence->text,
                                  VK_OBJECT_TYPE_MICROMAP_EXT, reinterpret_cast<uint64_t>(infos[i].dstMicromap));
            continue;
        }
        pushes.push_back(pushOf(device, infos[i]));
    }
    if (pushes.empty())
        return;
    InjectedWork work(device, commandBuffer);
    work.barrier();
    for (const MicromapPush &push : pushes)
        work.dispatch(InjectedShader::MicromapPlace, push, 1, 1);
    work.barrier();
    for (const MicromapPush &push : pushes)
        work.dispatch(InjectedShader::MicromapPack, push, uint64_t{push.triangleCount} * 16, 64);
    work.barrier();
}

VKAPI_ATTR void VKAPI_CALL getDeviceMicromapCompatibility(VkDevice, const VkMicromapVersionInfoEXT *,
                                                          VkAccelerationStructureCompatibilityKHR *compatibility)
{
    // Nothing can have been serialized with this version: vkCmdCopyMicromapToMemoryEXT is not there yet.
    *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

VKAPI_ATTR void VKAPI_CALL cmdCopyMicromap(VkCommandBuffer commandBuffer, const VkCopyMicromapInfoEXT *info)
{
    Device &device = deviceOf(commandBuffer);
    const Micromap *source = fromHandle(info->src);
    const Micromap *target = fromHandle(info->dst);
    if (!source || !target) {
        device.report().error("VELLUM-VUID-VkCopyMicromapInfoEXT-src-parameter",
                              "vkCmdCopyMicromapEXT: src or dst is VK_NULL_HANDLE");
        return;
    }
    // Nothing in a micromap depends on where it lies.
    const VkBufferCopy region{source->offset, target->offset, std::min(source->size, target->size)};
    InjectedWork work(device, commandBuffer);
    work.barrier();
    device.next.CmdCopyBuffer(commandBuffer, source->buffer, target->buffer, 1, &region);
    work.barrier();
}

VKAPI_ATTR VkResult VKAPI_CALL buildMicromaps(VkDevice handle, VkDeferredOperationKHR, uint32_t,
                                              const VkMicromapBuildInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkBuildMicromapsEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMicromap(VkDevice handle, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMicromapEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMicromapToMemory(VkDevice handle, VkDeferredOperationKHR,
                                                    const VkCopyMicromapToMemoryInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMicromapToMemoryEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMemoryToMicromap(VkDevice handle, VkDeferredOperationKHR,
                                                    const VkCopyMemoryToMicromapInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMemoryToMicromapEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL writeMicromapsProperties(VkDevice handle, uint32_t, const VkMicromapEXT *, VkQueryType,
                                                        size_t, void *, size_t)
{
    deviceOf(handle).report().notAvailable("vkWriteMicromapsPropertiesEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR void VKAPI_CALL cmdCopyMicromapToMemory(VkCommandBuffer commandBuffer, const VkCopyMicromapToMemoryInfoEXT *)
{
    deviceOf(commandBuffer).report().notAvailable("vkCmdCopyMicromapToMemoryEXT");
}

VKAPI_ATTR void VKAPI_CALL cmdCopyMemoryToMicromap(VkCommandBuffer commandBuffer, const VkCopyMemoryToMicromapInfoEXT *)
{
    deviceOf(commandBuffer).report().notAvailable("vkCmdCopyMemoryToMicromapEXT");
}

VKAPI_ATTR void VKAPI_CALL cmdWriteMicromapsProperties(VkCommandBuffer commandBuffer, uint32_t, const VkMicromapEXT *,
                                                       VkQueryType, VkQueryPool, uint32_t)
{
    deviceOf(commandBuffer).report().notAvailable("vkCmdWriteMicromapsPropertiesEXT");
}

} // namespace vellum::layer
