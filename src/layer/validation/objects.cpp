// SPDX-License-Identifier: Apache-2.0
// Queues, memory, buffers, images, acceleration structures and micromaps.
#include "layer/base/pnext.h"
#include "layer/input/checked.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/creation_rules.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer::validation
{
namespace
{

VkFlags64 usageOf(const VkBufferCreateInfo &info)
{
    const auto *usage = findInChain<VkBufferUsageFlags2CreateInfoKHR>(
        info.pNext, VK_STRUCTURE_TYPE_BUFFER_USAGE_FLAGS_2_CREATE_INFO_KHR);
    return usage ? usage->usage : info.usage;
}

void findAddress(DeviceValidation &device, ValidatedBuffer &buffer)
{
    if ((buffer.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) == 0)
        return;
    buffer.address = device.driver.bufferAddress(buffer.buffer());
    device.buffers.addresses.add(buffer.address, buffer.buffer(), buffer.size, buffer.usage);
}

void bound(DeviceValidation &device, VkBuffer handle, VkDeviceMemory memory, VkDeviceSize offset)
{
    const auto buffer = device.objects.buffers.get(handle);
    if (!buffer)
        return;
    buffer->memory = memory;
    buffer->memoryOffset = offset;
    if (const auto others = device.objects.memories.get(memory).buffers)
        others->add(buffer);
    findAddress(device, *buffer);
}

ValidatedMemory memoryOf(const DeviceValidation &device, const VkMemoryAllocateInfo &info)
{
    const VkMemoryPropertyFlags type = device.buffers.gpu.memory.memoryTypes[info.memoryTypeIndex].propertyFlags;
    return {.hostVisible = (type & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0,
            .buffers = std::make_shared<WeakList<ValidatedBuffer>>()};
}

std::shared_ptr<ValidatedStructure> newStructure(DeviceValidation &device, ObjectHandle handle,
                                                 VkAccelerationStructureTypeKHR type, VkBuffer buffer,
                                                 VkDeviceSize offset, VkDeviceSize size, VkFlags flags,
                                                 bool ownAllocator)
{
    auto structure = std::make_shared<ValidatedStructure>();
    structure->handle = handle;
    device.objects.destroyed.remove(handle);
    structure->number = ++device.numbers;
    structure->type = type;
    structure->createFlags = flags;
    structure->record = device.records.take();
    structure->buffer = device.objects.buffers.get(buffer);
    structure->offset = offset;
    structure->size = size;
    structure->ownAllocator = ownAllocator;
    if (structure->buffer && structure->buffer->address)
        structure->memoryAddress = structure->buffer->address + offset;
    if (structure->buffer)
        structure->buffer->structures.add(structure);
    return structure;
}

// Reports an object that was destroyed. Implementations would access its memory, or free it again.
bool isDestroyed(DeviceValidation &device, ObjectHandle object, const char *command, const char *member,
                 const char *vuid)
{
    const bool destroyed = device.checks.core && device.objects.destroyed.contains(object);
    const Place place(command);
    if (destroyed)
        device.at(place, object).report(vuid, member, "it was destroyed");
    return destroyed;
}

// Other objects may still refer to the structure, which is no longer valid.
void setLost(DeviceValidation &device, const ValidatedStructure &structure, const char *how)
{
    if (structure.isMicromap()) {
        const std::lock_guard lock(device.logs.submissions);
        if (mayBeDiscardable(device, structure))
            return;
    }
    remember(device.objects, [&] { device.objects.lost.add(structure, {++device.numbers, structure.handle, how}); });
    if (structure.record)
        remember(device.objects, [&] { device.records.setDestroyed(*structure.record); });
}

void setDestroyed(DeviceValidation &device, ValidatedStructure &structure)
{
    structure.destroyed = true;
    remember(device.objects, [&] { device.objects.destroyed.add(structure.handle); });
    setLost(device, structure, "was destroyed");
}

// Before an object is destroyed. `rule`: that commands which refer to it must be complete. `isTraced`: rays may meet
// it.
void checkUnused(DeviceValidation &device, const char *command, const char *rule, const ReferredObject &object,
                 bool isTraced = true)
{
    remember(device.objects, [&] {
        if (!sync::checkUnused(device.sync, Place(command), rule, object) || !isTraced)
            return;
        const HeldMessages held;
        const std::lock_guard lock(device.logs.submissions);
        device.traces.pending.check(device, Place(command), rule, object, device.pendingBatches());
    });
}

// The structures of a buffer that was destroyed or lost its memory.
void loseStructures(DeviceValidation &device, const ValidatedBuffer &buffer, const char *how)
{
    buffer.structures.visit([&](const std::shared_ptr<ValidatedStructure> &structure) {
        if (!structure->destroyed && lacksMemory(device, *structure))
            setLost(device, *structure, how);
    });
}

} // namespace

void getDeviceQueue(DeviceValidation &device, VkDevice handle, uint32_t family, uint32_t index, VkQueue *queue)
{
    device.next.GetDeviceQueue(handle, family, index, queue);
    remember(device.objects, [&] { device.objects.queueFamilies.set(*queue, family); });
}

void getDeviceQueue2(DeviceValidation &device, VkDevice handle, const VkDeviceQueueInfo2 *info, VkQueue *queue)
{
    device.next.GetDeviceQueue2(handle, info, queue);
    if (*queue)
        remember(device.objects, [&] { device.objects.queueFamilies.set(*queue, info->queueFamilyIndex); });
}

VkResult allocateMemory(DeviceValidation &device, VkDevice handle, const VkMemoryAllocateInfo *info,
                        const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const VkResult result = device.next.AllocateMemory(handle, info, allocator, memory);
    if (result == VK_SUCCESS)
        remember(device.objects, [&] { device.objects.memories.set(*memory, memoryOf(device, *info)); });
    return result;
}

void freeMemory(DeviceValidation &device, VkDevice handle, VkDeviceMemory memory,
                const VkAllocationCallbacks *allocator)
{
    device.sync.tracker.freeMemory(uint64_t(memory));
    {
        const std::lock_guard lock(device.logs.submissions);
        device.objects.constructed.forget(memory);
    }
    if (const auto buffers = device.objects.memories.take(memory).buffers) {
        // Those that were destroyed may be kept by command buffers; another one may have their handle.
        buffers->visit([&](const std::shared_ptr<ValidatedBuffer> &buffer) {
            if (!buffer->destroyed)
                device.buffers.addresses.hide(buffer->buffer());
        });
        buffers->visit([&](const std::shared_ptr<ValidatedBuffer> &buffer) {
            if (!buffer->destroyed)
                checkUnused(device, "vkFreeMemory", "VUID-vkFreeMemory-memory-00677", *buffer,
                            !buffer->structures.empty());
            ++device.objects.bufferLosses;
            buffer->memory = VK_NULL_HANDLE;
            buffer->memoryFreed = true;
            loseStructures(device, *buffer, "has lost its memory, which was freed");
        });
    }
    device.next.FreeMemory(handle, memory, allocator);
}

VkResult createBuffer(DeviceValidation &device, VkDevice handle, const VkBufferCreateInfo *info,
                      const VkAllocationCallbacks *allocator, VkBuffer *result)
{
    const VkResult created = device.next.CreateBuffer(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    remember(device.objects, [&] {
        auto buffer = std::make_shared<ValidatedBuffer>();
        buffer->handle = *result;
        buffer->number = ++device.numbers;
        buffer->size = info->size;
        buffer->usage = usageOf(*info);
        buffer->flags = info->flags;
        buffer->exclusive = info->sharingMode == VK_SHARING_MODE_EXCLUSIVE && !device.facts.maintenance9;
        device.objects.buffers.set(*result, buffer);
        if ((info->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0)
            device.objects.hasProtectedBuffers = true;
        if ((info->flags & VK_BUFFER_CREATE_SPARSE_BINDING_BIT) != 0)
            findAddress(device, *buffer); // such a buffer has one before it has memory
    });
    return created;
}

void destroyBuffer(DeviceValidation &device, VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    device.buffers.addresses.remove(buffer);
    if (const auto known = device.objects.buffers.take(buffer)) {
        checkUnused(device, "vkDestroyBuffer", "VUID-vkDestroyBuffer-buffer-00922", *known, !known->structures.empty());
        known->destroyed = true;
        ++device.objects.bufferLosses;
        loseStructures(device, *known, "has lost its buffer, which was destroyed");
    }
    device.next.DestroyBuffer(handle, buffer, allocator);
}

VkResult bindBufferMemory(DeviceValidation &device, VkDevice handle, VkBuffer buffer, VkDeviceMemory memory,
                          VkDeviceSize offset)
{
    const VkResult result = device.next.BindBufferMemory(handle, buffer, memory, offset);
    if (result == VK_SUCCESS)
        remember(device.objects, [&] { bound(device, buffer, memory, offset); });
    return result;
}

VkResult bindBufferMemory2(DeviceValidation &device, VkDevice handle, uint32_t count,
                           const VkBindBufferMemoryInfo *infos)
{
    const VkResult result = device.next.BindBufferMemory2(handle, count, infos);
    for (uint32_t i = 0; i < count; ++i)
        if (isBound(infos[i], result))
            remember(device.objects, [&] { bound(device, infos[i].buffer, infos[i].memory, infos[i].memoryOffset); });
    return result;
}

VkDeviceAddress getBufferDeviceAddress(DeviceValidation &device, VkDevice handle, const VkBufferDeviceAddressInfo *info)
{
    const VkDeviceAddress address = device.next.GetBufferDeviceAddress(handle, info);
    if (const auto buffer = device.objects.buffers.get(info->buffer); buffer && !buffer->address) { // it is sparse
        buffer->address = address;
        remember(device.objects,
                 [&] { device.buffers.addresses.add(address, info->buffer, buffer->size, buffer->usage); });
    }
    return address;
}

VkResult createAccelerationStructure(DeviceValidation &device, VkDevice handle,
                                     const VkAccelerationStructureCreateInfoKHR *info,
                                     const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    input::Creation creation = checkCreation(device, *info);
    const input::Checked checked(info, creation);
    const VkResult created = device.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    remember(device.objects, [&] {
        auto structure = newStructure(device, *result, info->type, info->buffer, info->offset, info->size,
                                      info->createFlags, allocator != nullptr);
        device.objects.byMemory.add(structure);
        device.objects.structures.set(*result, std::move(structure));
    });
    return created;
}

VkResult createAccelerationStructure2(DeviceValidation &device, VkDevice handle,
                                      const VkAccelerationStructureCreateInfo2KHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    input::Creation creation = checkCreation(device, *info);
    if (device.checks.core)
        ranges::checkCreation(device, *info);
    const input::Checked checked(info, creation);
    const VkResult created = device.next.CreateAccelerationStructure2KHR(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    remember(device.objects, [&] {
        const AddressMap::Location place = device.buffers.addresses.find(info->addressRange.address);
        auto structure = newStructure(device, *result, info->type, place.buffer, place.offset, info->addressRange.size,
                                      info->createFlags, allocator != nullptr);
        structure->memoryAddress = info->addressRange.address;
        structure->byAddress = true;
        device.objects.byMemory.add(structure);
        device.objects.structures.set(*result, std::move(structure));
    });
    return created;
}

void destroyAccelerationStructure(DeviceValidation &device, VkDevice handle, VkAccelerationStructureKHR structure,
                                  const VkAllocationCallbacks *allocator)
{
    if (isDestroyed(device, structure, "vkDestroyAccelerationStructureKHR", "accelerationStructure",
                    "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-parameter"))
        return;
    const auto known = device.objects.structures.take(structure);
    if (device.checks.core)
        checkDestruction(device, known.get(), allocator != nullptr);
    if (known) {
        checkUnused(device, "vkDestroyAccelerationStructureKHR",
                    "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02442", *known);
        setDestroyed(device, *known);
    }
    device.driver.report().setName(reinterpret_cast<uint64_t>(structure), "");
    device.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VkDeviceAddress getAccelerationStructureDeviceAddress(DeviceValidation &device, VkDevice handle,
                                                      const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    if (isDestroyed(device, info->accelerationStructure, "vkGetAccelerationStructureDeviceAddressKHR",
                    "pInfo.accelerationStructure",
                    "VUID-VkAccelerationStructureDeviceAddressInfoKHR-accelerationStructure-parameter"))
        return 0;
    const VkDeviceAddress address = device.next.GetAccelerationStructureDeviceAddressKHR(handle, info);
    if (const auto structure = device.objects.structures.get(info->accelerationStructure))
        remember(device.objects, [&] { setReference(device, structure, address); });
    if (device.objects.anyUnknown)
        device.records.setIncomplete();
    return address;
}

VkResult createMicromap(DeviceValidation &device, VkDevice handle, const VkMicromapCreateInfoEXT *info,
                        const VkAllocationCallbacks *allocator, VkMicromapEXT *result)
{
    input::Creation creation = checkCreation(device, *info);
    const input::Checked checked(info, creation);
    const VkResult created = device.next.CreateMicromapEXT(handle, info, allocator, result);
    if (created == VK_SUCCESS)
        remember(device.objects, [&] {
            device.objects.micromaps.set(
                *result, newStructure(device, *result, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
                                      info->buffer, info->offset, info->size, info->createFlags, allocator != nullptr));
        });
    return created;
}

void destroyMicromap(DeviceValidation &device, VkDevice handle, VkMicromapEXT micromap,
                     const VkAllocationCallbacks *allocator)
{
    if (isDestroyed(device, micromap, "vkDestroyMicromapEXT", "micromap",
                    "VUID-vkDestroyMicromapEXT-micromap-parameter"))
        return;
    const auto known = device.objects.micromaps.take(micromap);
    if (device.checks.core) {
        checkFeature(device.at(Place("vkDestroyMicromapEXT")), "VUID-vkDestroyMicromapEXT-micromap-11619");
        checkDestruction(device, known.get(), allocator != nullptr);
    }
    if (known) {
        checkUnused(device, "vkDestroyMicromapEXT", "VUID-vkDestroyMicromapEXT-micromap-07441", *known);
        setDestroyed(device, *known);
    }
    device.next.DestroyMicromapEXT(handle, micromap, allocator);
}

VkResult createImage(DeviceValidation &device, VkDevice handle, const VkImageCreateInfo *info,
                     const VkAllocationCallbacks *allocator, VkImage *image)
{
    const VkResult result = device.next.CreateImage(handle, info, allocator, image);
    if (result == VK_SUCCESS)
        remember(device.objects, [&] {
            device.objects.images.set(*image, std::make_shared<const ValidatedImage>(
                                                  ValidatedImage{info->format, info->flags, info->arrayLayers}));
        });
    return result;
}

void destroyImage(DeviceValidation &device, VkDevice handle, VkImage image, const VkAllocationCallbacks *allocator)
{
    device.objects.images.take(image);
    device.next.DestroyImage(handle, image, allocator);
}

} // namespace vellum::layer::validation
