// SPDX-License-Identifier: Apache-2.0
// Translates copies of micromaps, and records those of other structures.
#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/command_buffer/injected_work.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/khr_over_ext/ext_backend.h"
#include "layer/khr_over_ext/placed_micromaps.h"

namespace vellum::layer
{
namespace
{

constexpr VkAccelerationStructureTypeKHR kMicromap = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;

// VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07537 and VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07544; KHR requires 128.
bool checkAlignment(const DeviceKhrOverExt &device, VkDeviceAddress data, const char *what)
{
    if (data % 256 == 0)
        return true;
    device.driver.report().notAvailable(std::string(what) + " an address that is not a multiple of 256, on a driver "
                                                            "with VK_EXT_opacity_micromap only,");
    return false;
}

// The content of serialized data. The driver has separate commands for micromaps and for other structures, which are
// recorded before the device reads the data, and the headers are the same.
SerializedLocations::Data dataAt(const DeviceKhrOverExt &device, const SerializedLocations &locations,
                                 const AccelerationStructure &target, VkDeviceAddress source)
{
    auto data = locations.find(device.buffers, source);
    // The sizes of micromaps that applications see are marked.
    const bool isMicromap = target.type != kGeneric
                                ? target.type == kMicromap
                                : (data ? data->isMicromap : target.size % 256 == shared::kMicromapSizeMark);
    // Other data may have been written there in the meantime.
    if (!data || data->isMicromap != isMicromap)
        return {isMicromap};
    return *std::move(data);
}

// Changes the header of serialized data; `mode`: kSerialized*.
void recordHeader(const DeviceKhrOverExt &device, InjectedWork &work, VkDeviceAddress data, uint32_t mode)
{
    const VkDeviceSize bytes = device.buffers.addresses.find(data).bytes;
    const auto readable = static_cast<uint32_t>(std::min<VkDeviceSize>(bytes, ~0u));
    if (readable == 0)
        return; // in no known buffer
    work.dispatch(InjectedShader::SerializedHeader, shared::SerializedHeaderPush{data, readable, mode}, 1, 1);
    work.barrier();
}

} // namespace

VkDeviceSize ExtBackend::cloneBytes(const StructureCopy &copy)
{
    return copy.isMicromap() ? lastMicromap(device_, *copy.source).bytes
                             : 0; // the driver checks the size of other structures
}

void ExtBackend::record(VkCommandBuffer commandBuffer, const StructureCopy &copy)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureKHR";
    if (!copy.isMicromap()) {
        becomesStructure(*copy.target, copy.type, namesMicromaps(*copy.source));
        VkCopyAccelerationStructureInfoKHR info{VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR};
        info.src = copy.source->handle;
        info.dst = copy.target->handle;
        info.mode = copy.compact ? VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR
                                 : VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
        return device_.driver.next.CmdCopyAccelerationStructureKHR(commandBuffer, &info);
    }
    const PlacedMicromap from = lastMicromap(device_, *copy.source);
    PlacedMicromap to = from;
    // Only the device knows the size of a compacted copy; the size of the source and the target's capacity are bounds.
    if (copy.compact)
        to.bytes = std::min(from.bytes, capacityOf(device_.objects, *copy.target));
    to.handle = micromapOfSize(device_, *copy.target, to.bytes);
    if (!checkDriverMicromap(device_, kCommand, *copy.target, from.handle && to.handle ? to.handle : VK_NULL_HANDLE))
        return;
    VkCopyMicromapInfoEXT info{VK_STRUCTURE_TYPE_COPY_MICROMAP_INFO_EXT};
    info.src = from.handle;
    info.dst = to.handle;
    info.mode = copy.compact ? VK_COPY_MICROMAP_MODE_COMPACT_EXT : VK_COPY_MICROMAP_MODE_CLONE_EXT;
    setDriverMicromap(device_, *copy.target, std::move(to));
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    device_.driver.next.CmdCopyMicromapEXT(commandBuffer, &info);
    work.barrier();
}

void ExtBackend::recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureToMemoryKHR";
    const AccelerationStructure &source = *copy.structure;
    if (copy.content != kMicromap) {
        if (namesMicromaps(source)) {
            device_.driver.report().notAvailable(std::string(kCommand) +
                                                 " of a bottom-level structure with micromaps, on a driver with "
                                                 "VK_EXT_opacity_micromap only,");
            return;
        }
        VkCopyAccelerationStructureToMemoryInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
        info.src = source.handle;
        info.dst.deviceAddress = copy.data;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        serialized_.set(device_.buffers, copy.data, {});
        return device_.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &info);
    }
    if (!checkAlignment(device_, copy.data, "serializing a micromap to") ||
        InjectedWork::rejectedIn(device_.commands, commandBuffer, kCommand))
        return;
    PlacedMicromap micromap = lastMicromap(device_, source);
    if (!checkDriverMicromap(device_, kCommand, source, micromap.handle))
        return;
    VkCopyMicromapToMemoryInfoEXT info{VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT};
    info.src = micromap.handle;
    info.dst.deviceAddress = copy.data;
    info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    serialized_.set(device_.buffers, copy.data, {true, micromap.isKnown, std::move(micromap.usages)});
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    device_.driver.next.CmdCopyMicromapToMemoryEXT(commandBuffer, &info);
    work.barrier();
    recordHeader(device_, work, copy.data, shared::kSerializedSeal);
}

void ExtBackend::recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    constexpr const char *kCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";
    AccelerationStructure &target = *copy.structure;
    SerializedLocations::Data data = dataAt(device_, serialized_, target, copy.data);
    if (!data.isMicromap) {
        becomesStructure(target, target.type, false);
        VkCopyMemoryToAccelerationStructureInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_MEMORY_TO_ACCELERATION_STRUCTURE_INFO_KHR};
        info.src.deviceAddress = copy.data;
        info.dst = target.handle;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        return device_.driver.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, &info);
    }
    if (!checkAlignment(device_, copy.data, "deserializing a micromap from") ||
        InjectedWork::rejectedIn(device_.commands, commandBuffer, kCommand))
        return;
    PlacedMicromap micromap;
    micromap.bytes = capacityOf(device_.objects, target);
    micromap.isKnown = data.isKnown;
    micromap.usages = std::move(data.usages);
    micromap.handle = micromapOfSize(device_, target, micromap.bytes);
    if (!checkDriverMicromap(device_, kCommand, target, micromap.handle))
        return;
    VkCopyMemoryToMicromapInfoEXT info{VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT};
    info.src.deviceAddress = copy.data;
    info.dst = micromap.handle;
    info.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    setDriverMicromap(device_, target, std::move(micromap));
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    recordHeader(device_, work, copy.data, shared::kSerializedOpen);
    device_.driver.next.CmdCopyMemoryToMicromapEXT(commandBuffer, &info);
    work.barrier();
    recordHeader(device_, work, copy.data, shared::kSerializedClose);
}

} // namespace vellum::layer
