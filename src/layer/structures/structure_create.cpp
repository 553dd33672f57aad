#include "layer/structures/structure_create.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>

#include "layer/ground/judge.h"
#include "layer/ground/undo.h"
#include "layer/micromaps/micromap_structure.h"
#include "layer/objects/buffer_range.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/fitted_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

void forgetStructure(DeviceStructures &device, AccelerationStructure &structure)
{
    leavePlace(device.objects, structure);
    destroyFittedHandles(device, structure);
    // Another thread may be asking for the address of the buffer, which names the micromaps in it: bufferHasAddress().
    std::lock_guard lock(device.objects.unnamedMutex);
    std::erase_if(device.objects.unnamedMicromaps, [&](const std::weak_ptr<AccelerationStructure> &unnamed) {
        const auto other = unnamed.lock();
        return !other || other.get() == &structure;
    });
    if (structure.micromapKey)
        device.objects.root.releaseCell(structure.micromapKey);
}

// A new structure has its handle, and is known from now on; not if this throws.
void addStructure(DeviceStructures &device, std::shared_ptr<AccelerationStructure> structure,
                  VkAccelerationStructureKHR handle)
{
    structure->micromap = {structure->buffer,
                           structure->offset,
                           structure->size,
                           {VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(handle)}};
    takePlace(device.objects, *structure, handle);
    Undo undo([&] { forgetStructure(device, *structure); });
    letMicromapBeNamedOnceBound(device.objects, structure);
    device.objects.accelerationStructures.set(handle, structure);
    undo.keep();
}

// One of the layer's own handles, which never reach the driver.
VkAccelerationStructureKHR addMicromap(DeviceStructures &device, const BufferRange &place)
{
    auto structure = newStructure(place, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    const auto handle = reinterpret_cast<VkAccelerationStructureKHR>(structure.get());
    addStructure(device, std::move(structure), handle);
    return handle;
}

// A micromap made as other structures are, by a buffer.
VkResult createMicromapInBuffer(DeviceStructures &device, const VkAccelerationStructureCreateInfoKHR &info,
                                VkAccelerationStructureKHR &result)
{
    const Judge judge(device.driver.report(), "vkCreateAccelerationStructureKHR");
    const VkDeviceSize bytes = device.buffers.infos.get(info.buffer).size;
    const bool inBuffer = info.offset % 16 == 0 && info.offset < bytes;
    if (!judge.weigh(inBuffer, "VELLUM-VUID-VkAccelerationStructureCreateInfoKHR-type-11600",
                     "a micromap is made by vkCreateAccelerationStructure2KHR"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    result = addMicromap(device, {info.buffer, info.offset, std::min(info.size, bytes - info.offset)});
    return VK_SUCCESS;
}

} // namespace

VkResult createAccelerationStructure(DeviceStructures &device, VkDevice handle,
                                     const VkAccelerationStructureCreateInfoKHR *info,
                                     const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return createMicromapInBuffer(device, *info, *result);
    auto structure = newStructure({info->buffer, info->offset, info->size}, info->type);
    const VkResult created = device.driver.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(handle, *result, allocator); });
    addStructure(device, std::move(structure), *result);
    undo.keep();
    return created;
}

void destroyAccelerationStructure(DeviceStructures &device, VkDevice handle, VkAccelerationStructureKHR structure,
                                  const VkAllocationCallbacks *allocator)
{
    const auto known = device.objects.accelerationStructures.take(structure);
    if (known)
        forgetStructure(device, *known);
    device.driver.report().setName(reinterpret_cast<uint64_t>(structure), "");
    if (known && known->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        device.objects.privateData.forgetObject(reinterpret_cast<uint64_t>(structure));
        return;
    }
    device.driver.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VkDeviceAddress getAccelerationStructureDeviceAddress(DeviceStructures &device, VkDevice handle,
                                                      const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    // Whoever names a structure to an instance asks for its address: from now on copies of top-level structures know
    // that it exists.
    if (const auto structure = device.objects.accelerationStructures.get(info->accelerationStructure)) {
        if (structure->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
            return beginOf(device.driver, *structure);
        cellOf(device.objects, *structure, info->accelerationStructure);
    }
    return device.driver.next.GetAccelerationStructureDeviceAddressKHR(handle, info);
}

VkResult getAccelerationStructureCaptureData(DeviceStructures &device, VkDevice handle,
                                             const VkAccelerationStructureCaptureDescriptorDataInfoEXT *info,
                                             void *data)
{
    const auto structure = device.objects.accelerationStructures.get(info->accelerationStructure);
    if (!structure || structure->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return device.driver.next.GetAccelerationStructureOpaqueCaptureDescriptorDataEXT(handle, info, data);
    // Nothing is known to the driver that it could replay.
    VkPhysicalDeviceDescriptorBufferPropertiesEXT sizes{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_BUFFER_PROPERTIES_EXT};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &sizes, {}};
    device.driver.instance->GetPhysicalDeviceProperties2(device.driver.physicalDevice, &properties);
    std::memset(data, 0, sizes.accelerationStructureCaptureReplayDescriptorDataSize);
    return VK_SUCCESS;
}

void getAccelerationStructureBuildSizes(DeviceStructures &device, VkDevice handle,
                                        VkAccelerationStructureBuildTypeKHR type,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                        const uint32_t *maxPrimitives, VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    if (isMicromapBuild(*info))
        return getMicromapStructureSizes(device.micromaps, *info, *sizes);
    DriverBuildInfo build(*info);
    if (build.hasMicromapGeometry()) {
        device.driver.report().error("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                                     "vkGetAccelerationStructureBuildSizesKHR: a geometry of type "
                                     "VK_GEOMETRY_TYPE_MICROMAP_KHR in a build that is none of a micromap");
        sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
        return;
    }
    device.driver.next.GetAccelerationStructureBuildSizesKHR(handle, type, &build.info(), maxPrimitives, sizes);
    if (build.topLevel() && build.geometryCount() == 1) {
        const uint32_t count = maxPrimitives ? maxPrimitives[0] : 0;
        sizes->accelerationStructureSize = topLevelBytes(device.driver, info->flags, count);
        sizes->buildScratchSize =
            topLevelDriverSizes(device.driver, info->flags, count).buildScratchSize + patchedInstancesBytes(count);
        sizes->updateScratchSize = sizes->buildScratchSize; // an update is a build
    } else if (const VkDeviceSize tail = bottomLevelTailBytes(build, maxPrimitives)) {
        sizes->accelerationStructureSize = alignUp(sizes->accelerationStructureSize, kPartAlignment) + tail;
    } else if (device.driver.clearsWholeHandles) {
        // The layer's copies count in units.
        sizes->accelerationStructureSize = alignUp(sizes->accelerationStructureSize, 16);
    }
}

VkResult createAccelerationStructure2(DeviceStructures &device, VkDevice handle,
                                      const VkAccelerationStructureCreateInfo2KHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    const BufferRange place = rangeOf(device.objects, *info, 16);
    if (!place.buffer)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        *result = addMicromap(device, place);
        return VK_SUCCESS;
    }
    auto structure = newStructure(place, info->type);
    const VkResult created = createInRange(device.driver, *info, place, allocator, *result);
    if (created != VK_SUCCESS)
        return created;
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(handle, *result, allocator); });
    addStructure(device, std::move(structure), *result);
    undo.keep();
    return created;
}

} // namespace vellum::layer
