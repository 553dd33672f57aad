// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/creation_rules.h"

#include "layer/rules/creations.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags kBufferReplay = VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT;
constexpr VkFlags kReplay = VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR;
constexpr VkFlags kDescriptorReplay = VK_ACCELERATION_STRUCTURE_CREATE_DESCRIPTOR_BUFFER_CAPTURE_REPLAY_BIT_EXT;

// The buffer that has the range of a structure.
void checkBuffer(const InputCheck &check, const ValidatedBuffer &buffer, VkFlags createFlags)
{
    if ((buffer.flags & VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT) != 0)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11604", "addressRange",
                     "its buffer was created with VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT");
    const bool replaysBuffer = (buffer.flags & kBufferReplay) != 0;
    const bool replays = (createFlags & kReplay) != 0;
    if (replaysBuffer && !replays)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11606", "createFlags",
                     "the buffer was created for capture and replay of its address, the structure is not");
    if (replays && !replaysBuffer)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11607", "createFlags",
                     "the structure is for capture and replay of its address, its buffer is not");
}

void checkMicromapBuffer(const InputCheck &check, const ValidatedBuffer &buffer)
{
    if ((buffer.usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT) == 0)
        check.report("VUID-VkMicromapCreateInfoEXT-buffer-07435", "buffer",
                     "it was created without VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT");
    if ((buffer.flags & VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT) != 0)
        check.report("VUID-VkMicromapCreateInfoEXT-buffer-07436", "buffer",
                     "it was created with VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT");
}

bool isType(VkAccelerationStructureTypeKHR type)
{
    return type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR ||
           type == VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR ||
           type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ||
           type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}

} // namespace

input::Creation checkCreation(DeviceModel &device, const VkMicromapCreateInfoEXT &info)
{
    const Place command("vkCreateMicromapEXT");
    const Place place = command.member("pCreateInfo");
    const InputCheck check = device.at(place, info.buffer);
    const auto buffer = device.objects.buffers.get(info.buffer);
    if (device.checks.core && !buffer && !device.objects.anyUnknown)
        check.report("VUID-VkMicromapCreateInfoEXT-buffer-parameter", "buffer",
                     info.buffer ? "it is not a buffer of this device" : "it is VK_NULL_HANDLE");
    const input::Creation creation = rules::checkCreation(check, info, buffer ? buffer->size : UINT64_MAX);
    if (!device.checks.core)
        return creation;
    checkStructure(check, info, kMicromapCreateInfo);
    checkFeature(check, "VUID-vkCreateMicromapEXT-micromap-11615");
    if (buffer)
        checkMicromapBuffer(check, *buffer);
    return creation;
}

input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfoKHR &info)
{
    const Place command("vkCreateAccelerationStructureKHR");
    const Place place = command.member("pCreateInfo");
    const auto buffer = device.objects.buffers.get(info.buffer);
    return rules::checkCreation(device.at(place, info.buffer), info, buffer ? buffer->size : UINT64_MAX);
}

input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfo2KHR &info)
{
    const Place command("vkCreateAccelerationStructure2KHR");
    const Place place = command.member("pCreateInfo");
    const InputCheck check = device.at(place);
    const input::Creation creation = rules::checkCreation(check, info);
    if (!device.checks.core)
        return creation;
    if (info.sType != VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-sType-sType", "sType",
                     "it is that of " + nameOf(info.sType));
    if (!isType(info.type) && !device.driver.enabled.otherStructures)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-type-parameter", "type",
                     "it is " + std::to_string(info.type));
    // If several buffers are at the address, the host does not know which one the application means.
    const VkBuffer only = device.buffers.addresses.onlyCovering(info.addressRange.address, info.addressRange.size);
    if (const auto buffer = only ? device.objects.buffers.get(only) : nullptr)
        checkBuffer(check, *buffer, info.createFlags);
    if ((info.createFlags & kReplay) != 0 && !device.facts.structureCaptureReplay)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-03613", "createFlags",
                     "it requests capture and replay; the feature accelerationStructureCaptureReplay is not enabled");
    if ((info.createFlags & kReplay) != 0 && device.facts.isGroup && !device.facts.addressMultiDevice)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11673", "createFlags",
                     "it requests capture and replay on several physical devices; the feature "
                     "bufferDeviceAddressMultiDevice is not enabled");
    if (creation.isMicromap && (info.createFlags & kDescriptorReplay) != 0)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11610", "createFlags",
                     "DESCRIPTOR_BUFFER_CAPTURE_REPLAY is not for micromaps");
    if (creation.isMicromap && (info.createFlags & VK_ACCELERATION_STRUCTURE_CREATE_MOTION_BIT_NV) != 0)
        check.report("VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11611", "createFlags",
                     "MOTION is not for micromaps");
    return creation;
}

void checkDestruction(DeviceModel &device, const ValidatedStructure *structure, bool allocator)
{
    if (!structure)
        return;
    const bool ext = structure->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
    const Place command(ext ? "vkDestroyMicromapEXT" : "vkDestroyAccelerationStructureKHR");
    const InputCheck check = device.at(command, structure->handle);
    if (!allocator && structure->ownAllocator)
        check.report(ext ? "VUID-vkDestroyMicromapEXT-micromap-07442"
                         : "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02443",
                     "pAllocator", "it is null; the object was created with allocation callbacks");
    if (allocator && !structure->ownAllocator)
        check.report(ext ? "VUID-vkDestroyMicromapEXT-micromap-07443"
                         : "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02444",
                     "pAllocator", "it is not null; the object was created without allocation callbacks");
}

} // namespace vellum::layer
