#include <algorithm>
#include <string>

#include "layer/ground/undo.h"
#include "layer/objects/buffer_range.h"
#include "layer/translation/device_translation.h"
#include "layer/translation/placed_micromaps.h"
#include "layer/translation/translation.h"

namespace vellum::layer
{
namespace
{

void addStructure(DeviceTranslation &device, std::shared_ptr<AccelerationStructure> structure,
                  VkAccelerationStructureKHR handle)
{
    takePlace(device.objects, *structure, handle);
    Undo undo([&] { leavePlace(device.objects, *structure); });
    device.objects.accelerationStructures.set(handle, structure);
    undo.keep();
}

// A handle of the layer's own, and a micromap of the driver's.
VkResult addMicromap(DeviceTranslation &device, const Judge &judge, const BufferRange &range,
                     VkAccelerationStructureKHR &result)
{
    if (!device.driver.next.CreateMicromapEXT) {
        judge.refuse("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609",
                     "type is OPACITY_MICROMAP, but VK_KHR_opacity_micromap is not enabled");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    // VUID-VkMicromapCreateInfoEXT-buffer-07496
    const VkFlags64 usage = device.buffers.infos.get(range.buffer).usage;
    if ((usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT) == 0) {
        judge.refuse("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603",
                     "the buffer is none for acceleration structures");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    if (!mayHaveMicromapAt(device, range.buffer, range.offset)) {
        judge.refuse("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605",
                     "the address of a micromap is not a multiple of 256");
        return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    auto structure = newStructure(range, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    const auto handle = reinterpret_cast<VkAccelerationStructureKHR>(structure.get());
    takePlace(device.objects, *structure, handle);
    Undo undo([&] { leavePlace(device.objects, *structure); });
    if (!micromapOfSize(device, *structure, structure->size))
        return VK_ERROR_OUT_OF_HOST_MEMORY; // the one error that vkCreateMicromapEXT has
    device.objects.accelerationStructures.set(handle, structure);
    result = handle;
    undo.keep();
    return VK_SUCCESS;
}

} // namespace

VkResult createTranslatedStructure(DeviceTranslation &device, VkDevice handle,
                                   const VkAccelerationStructureCreateInfoKHR *info,
                                   const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        const Judge judge(device.driver.report(), "vkCreateAccelerationStructureKHR");
        const VkDeviceSize bytes = device.buffers.infos.get(info->buffer).size;
        if (!judge.weigh(info->offset < bytes, "VELLUM-VUID-VkAccelerationStructureCreateInfoKHR-type-11600",
                         "a micromap is made by vkCreateAccelerationStructure2KHR"))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        return addMicromap(device, judge, {info->buffer, info->offset, std::min(info->size, bytes - info->offset)},
                           *result);
    }
    auto structure = newStructure({info->buffer, info->offset, info->size}, info->type);
    const VkResult created = device.driver.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(handle, *result, allocator); });
    addStructure(device, std::move(structure), *result);
    undo.keep();
    return created;
}

VkResult createTranslatedStructure2(DeviceTranslation &device, VkDevice handle,
                                    const VkAccelerationStructureCreateInfo2KHR *info,
                                    const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    const BufferRange range = rangeOf(device.objects, *info, 256);
    if (!range.buffer)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return addMicromap(device, {device.driver.report(), "vkCreateAccelerationStructure2KHR"}, range, *result);
    auto structure = newStructure(range, info->type);
    const VkResult created = createInRange(device.driver, *info, range, allocator, *result);
    if (created != VK_SUCCESS)
        return created;
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(handle, *result, allocator); });
    addStructure(device, std::move(structure), *result);
    undo.keep();
    return created;
}

void destroyTranslatedStructure(DeviceTranslation &device, VkDevice handle, VkAccelerationStructureKHR structure,
                                const VkAllocationCallbacks *allocator)
{
    const auto known = device.objects.accelerationStructures.take(structure);
    if (known)
        leavePlace(device.objects, *known);
    device.driver.report().setName(reinterpret_cast<uint64_t>(structure), "");
    if (known && !isDrivers(known.get())) {
        device.objects.privateData.forgetObject(reinterpret_cast<uint64_t>(structure));
        return;
    }
    device.driver.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VkDeviceAddress getTranslatedStructureAddress(DeviceTranslation &device, VkDevice handle,
                                              const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    const auto structure = device.objects.accelerationStructures.get(info->accelerationStructure);
    if (!structure || isDrivers(structure.get()))
        return device.driver.next.GetAccelerationStructureDeviceAddressKHR(handle, info);
    // VUID-VkBufferDeviceAddressInfo-buffer-02601
    const bool hasAddress =
        (device.buffers.infos.get(structure->buffer).usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
    return hasAddress ? beginOf(device.driver, *structure) : 0;
}

void getTranslatedCompatibility(DeviceTranslation &device, VkDevice handle,
                                const VkAccelerationStructureVersionInfoKHR *info,
                                VkAccelerationStructureCompatibilityKHR *compatibility)
{
    // Whose header it is cannot be told: those of micromaps are just as long, and serialized data is compatible with
    // what it was made of only.
    device.driver.next.GetDeviceAccelerationStructureCompatibilityKHR(handle, info, compatibility);
    if (*compatibility == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR || !device.driver.asked.khr)
        return;
    const VkMicromapVersionInfoEXT micromap{VK_STRUCTURE_TYPE_MICROMAP_VERSION_INFO_EXT, nullptr, info->pVersionData};
    device.driver.next.GetDeviceMicromapCompatibilityEXT(handle, &micromap, compatibility);
}

} // namespace vellum::layer
