// SPDX-License-Identifier: Apache-2.0
// The back end without its builds (ext_builds.cpp): copies of micromaps are translated, those of other structures are
// recorded as they are.
#include <algorithm>
#include <array>
#include <string>

#include "core/records.h"
#include "layer/command_buffer/injected_work.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/khr_over_ext/placed_micromaps.h"

namespace vellum::layer
{

bool ExtBackend::begin(VkCommandBuffer commandBuffer, const char *)
{
    if (const auto state = device_.commands.states.get(commandBuffer))
        state->scratch.restart();
    return true;
}

MicromapSupport ExtBackend::support() const
{
    return {limits_, false, device_.driver.enabled.ext || device_.driver.enabled.khr, true};
}

bool ExtBackend::placesMicromap(VkBuffer buffer, VkDeviceSize offset, VkDeviceAddress) const
{
    // VUID-VkMicromapCreateInfoEXT-buffer-07435
    const bool hasUsage = (device_.buffers.infos.get(buffer).usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT) != 0;
    return device_.driver.next.CreateMicromapEXT && hasUsage && allowsMicromapAt(device_, buffer, offset);
}

bool ExtBackend::createMicromap(AccelerationStructure &micromap)
{
    return micromapOfSize(device_, micromap, micromap.size) != VK_NULL_HANDLE;
}

void ExtBackend::recordMicromapAnswer(VkCommandBuffer commandBuffer, const Property &property)
{
    const DeviceTable &next = device_.driver.next;
    const PlacedMicromap micromap = lastMicromap(device_, property.structure);
    const VkQueryType own = property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR
                                ? VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT
                                : VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
    switch (property.type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR:
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR:
        if (!micromap.handle)
            return;
        next.CmdWriteMicromapsPropertiesEXT(commandBuffer, 1, &micromap.handle, own, property.micromapPool,
                                            property.query);
        return next.CmdCopyQueryPoolResults(commandBuffer, property.micromapPool, property.query, 1, property.buffer,
                                            property.offset, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR: {
        // EXT has no such query. A clone has as many bytes as its source:
        // VUID-VkCopyAccelerationStructureInfoKHR-mode-12418.
        const uint64_t bytes = markedMicromapSize(micromap.bytes);
        return next.CmdUpdateBuffer(commandBuffer, property.buffer, property.offset, sizeof bytes, &bytes);
    }
    default: return;
    }
}

void ExtBackend::recordCorrections(VkCommandBuffer, InjectedWork &work, std::span<const Property> properties)
{
    // The size marks a structure that is created with it as one for a micromap. Applications may create the target of a
    // deserialization with the size of the serialized data.
    for (const Property &property : properties) {
        if (property.micromap && (property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
                                  property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR))
            work.dispatch(InjectedShader::MarkedSize, shared::MarkedSizePush{property.address}, 1, 1);
    }
}

namespace
{

constexpr VkAccelerationStructureTypeKHR kMicromap = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;

// Serialized data is the driver's, as it is. In that of micromaps both extensions define two UUIDs only, and the same
// ones: "serialized-as-header" and "serialized-micromap-header" of the specification.

// VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07537 and VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07544; KHR requires 128.
bool checkAlignment(const DeviceKhrOverExt &device, VkDeviceAddress data, const char *what)
{
    if (data % 256 == 0)
        return true;
    device.driver.report().notAvailable(std::string(what) + " an address that is not a multiple of 256, on a driver "
                                                            "with VK_EXT_opacity_micromap only,");
    return false;
}

bool isMicromapVersion(const DeviceKhrOverExt &device, const uint8_t *version)
{
    const VkMicromapVersionInfoEXT info{VK_STRUCTURE_TYPE_MICROMAP_VERSION_INFO_EXT, nullptr, version};
    VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
    if (device.driver.enabled.khr)
        device.driver.next.GetDeviceMicromapCompatibilityEXT(device.driver.handle, &info, &result);
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

bool isStructureVersion(const DeviceKhrOverExt &device, const VkAccelerationStructureVersionInfoKHR &info)
{
    VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
    device.driver.next.GetDeviceAccelerationStructureCompatibilityKHR(device.driver.handle, &info, &result);
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

// Returns whether serialized data is a micromap. The driver has separate commands for micromaps and for other
// structures, and the choice is made before the device reads the data. For a GENERIC target, the version in mapped
// memory decides if only one of both can have it; otherwise the size of the target.
bool holdsSerializedMicromap(const DeviceKhrOverExt &device, const AccelerationStructure &target, VkDeviceAddress data)
{
    if (target.type != kGeneric || !device.driver.enabled.khr)
        return target.type == kMicromap;
    std::array<uint8_t, 2 * VK_UUID_SIZE> version;
    const AddressMap::Location location = device.buffers.addresses.find(data);
    if (location.buffer && location.bytes >= version.size() &&
        device.buffers.host.peek(location.buffer, location.offset, version.data(), version.size())) {
        const bool isMicromap = isMicromapVersion(device, version.data());
        if (isMicromap != isStructureVersion(device, {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_VERSION_INFO_KHR,
                                                      nullptr, version.data()}))
            return isMicromap;
    }
    // The layer reports such sizes for micromaps.
    return target.size % 256 == shared::kMicromapSizeMark;
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
        return device_.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &info);
    }
    if (!checkAlignment(device_, copy.data, "serializing a micromap to"))
        return;
    const PlacedMicromap micromap = lastMicromap(device_, source);
    if (!checkDriverMicromap(device_, kCommand, source, micromap.handle))
        return;
    VkCopyMicromapToMemoryInfoEXT info{VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT};
    info.src = micromap.handle;
    info.dst.deviceAddress = copy.data;
    info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    device_.driver.next.CmdCopyMicromapToMemoryEXT(commandBuffer, &info);
    work.barrier();
}

void ExtBackend::recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    constexpr const char *kCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";
    AccelerationStructure &target = *copy.structure;
    if (!holdsSerializedMicromap(device_, target, copy.data)) {
        becomesStructure(target, target.type, false);
        VkCopyMemoryToAccelerationStructureInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_MEMORY_TO_ACCELERATION_STRUCTURE_INFO_KHR};
        info.src.deviceAddress = copy.data;
        info.dst = target.handle;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        return device_.driver.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, &info);
    }
    if (!checkAlignment(device_, copy.data, "deserializing a micromap from"))
        return;
    PlacedMicromap micromap; // of unknown levels and formats
    micromap.bytes = capacityOf(device_.objects, target);
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
    device_.driver.next.CmdCopyMemoryToMicromapEXT(commandBuffer, &info);
    work.barrier();
}

VkAccelerationStructureCompatibilityKHR ExtBackend::compatibility(const VkAccelerationStructureVersionInfoKHR &info)
{
    // The version data of both types has the same length. It is compatible only with the type that was serialized.
    return isStructureVersion(device_, info) || isMicromapVersion(device_, info.pVersionData)
               ? VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR
               : VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

} // namespace vellum::layer
