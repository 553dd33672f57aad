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
void checkBuffer(const RuleCheck &check, const ValidatedBuffer &buffer, VkFlags createFlags)
{
    constexpr const char *kMember = "addressRange";
    check.require((buffer.flags & VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT) == 0, kMember,
                  "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11604",
                  "its buffer was created with VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT");
    const bool replaysBuffer = (buffer.flags & kBufferReplay) != 0;
    const bool replays = (createFlags & kReplay) != 0;
    check.require(replays || !replaysBuffer, "createFlags",
                  "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11606",
                  "the buffer was created for capture and replay of its address, the structure is not");
    check.require(replaysBuffer || !replays, "createFlags",
                  "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11607",
                  "the structure is for capture and replay of its address, its buffer is not");
}

void checkRange(const RuleCheck &check, const VkDeviceAddressRangeKHR &range, VkFlags createFlags)
{
    // If several buffers are at the address, the host does not know which one the application means.
    const DeviceModel &device = check.device();
    const VkBuffer only = device.buffers.addresses.onlyCovering(range.address, range.size);
    if (const auto buffer = only ? device.objects.buffers.get(only) : nullptr)
        checkBuffer(check, *buffer, createFlags);
}

void checkMicromapBuffer(const RuleCheck &check, const ValidatedBuffer &buffer)
{
    check.require((buffer.usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT) != 0, "buffer",
                  "VUID-VkMicromapCreateInfoEXT-buffer-07435",
                  "it was created without VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT");
    check.require((buffer.flags & VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT) == 0, "buffer",
                  "VUID-VkMicromapCreateInfoEXT-buffer-07436",
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
    const auto buffer = device.objects.buffers.get(info.buffer);
    if (device.checks.core && !buffer && !device.objects.anyUnknown)
        device.fault(place.member("buffer"), "VUID-VkMicromapCreateInfoEXT-buffer-parameter",
                     info.buffer ? "it is not a buffer of this device" : "it is VK_NULL_HANDLE", info.buffer);
    const input::Creation creation = rules::checkCreation(InputCheck(device.state.rules, place, info.buffer), info,
                                                          buffer ? buffer->size : UINT64_MAX);
    if (!device.checks.core)
        return creation;
    const RuleCheck check(device, place, info.buffer);
    checkStructure(check, info, kMicromapCreateInfo);
    if (!device.driver.enabled.extFeature)
        check.fault("VUID-vkCreateMicromapEXT-micromap-11615", "the feature micromap is not enabled");
    if (buffer)
        checkMicromapBuffer(check, *buffer);
    return creation;
}

input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfoKHR &info)
{
    const Place command("vkCreateAccelerationStructureKHR");
    const Place place = command.member("pCreateInfo");
    const auto buffer = device.objects.buffers.get(info.buffer);
    return rules::checkCreation(InputCheck(device.state.rules, place, info.buffer), info,
                                buffer ? buffer->size : UINT64_MAX);
}

input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfo2KHR &info)
{
    const Place command("vkCreateAccelerationStructure2KHR");
    const Place place = command.member("pCreateInfo");
    const input::Creation creation = rules::checkCreation(InputCheck(device.state.rules, place), info);
    if (!device.checks.core)
        return creation;
    const RuleCheck check(device, place);
    if (info.sType != VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR)
        check.fault("sType", "VUID-VkAccelerationStructureCreateInfo2KHR-sType-sType",
                    "it is that of " + nameOf(info.sType));
    if (!isType(info.type) && !device.driver.enabled.otherStructures)
        check.fault("type", "VUID-VkAccelerationStructureCreateInfo2KHR-type-parameter",
                    "it is " + std::to_string(info.type));
    checkRange(check, info.addressRange, info.createFlags);
    if ((info.createFlags & kReplay) != 0) {
        check.require(device.facts.structureCaptureReplay, "createFlags",
                      "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-03613",
                      "it requests capture and replay; the feature accelerationStructureCaptureReplay is not enabled");
        check.require(!device.facts.isGroup || device.facts.addressMultiDevice, "createFlags",
                      "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11673",
                      "it requests capture and replay on several physical devices; the feature "
                      "bufferDeviceAddressMultiDevice is not enabled");
    }
    if (info.type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return creation;
    check.require((info.createFlags & kDescriptorReplay) == 0, "createFlags",
                  "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11610",
                  "DESCRIPTOR_BUFFER_CAPTURE_REPLAY is not for micromaps");
    check.require((info.createFlags & VK_ACCELERATION_STRUCTURE_CREATE_MOTION_BIT_NV) == 0, "createFlags",
                  "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11611", "MOTION is not for micromaps");
    return creation;
}

void checkMicromapDestruction(DeviceModel &device)
{
    if (!device.driver.enabled.extFeature)
        device.fault(Place("vkDestroyMicromapEXT"), "VUID-vkDestroyMicromapEXT-micromap-11619",
                     "the feature micromap is not enabled");
}

void checkDestruction(DeviceModel &device, const ValidatedStructure *structure, bool allocator)
{
    if (!structure)
        return;
    const bool ext = structure->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
    const Place command(ext ? "vkDestroyMicromapEXT" : "vkDestroyAccelerationStructureKHR");
    const RuleCheck check(device, command, structure->handle);
    check.require(allocator || !structure->ownAllocator, "pAllocator",
                  ext ? "VUID-vkDestroyMicromapEXT-micromap-07442"
                      : "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02443",
                  "it is null; the object was created with allocation callbacks");
    check.require(!allocator || structure->ownAllocator, "pAllocator",
                  ext ? "VUID-vkDestroyMicromapEXT-micromap-07443"
                      : "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02444",
                  "it is not null; the object was created without allocation callbacks");
}

} // namespace vellum::layer
