// SPDX-License-Identifier: Apache-2.0
// Queues, memory, buffers, images, acceleration structures and micromaps.
#include "layer/base/pnext.h"
#include "layer/input/checked.h"
#include "layer/rules/creations.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/rule_check.h"

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

// Adds a structure or a micromap to the model.
void addStructure(DeviceValidation &device, ObjectHandle handle, VkAccelerationStructureTypeKHR type,
                  const input::Creation &creation, VkFlags flags, bool ownAllocator)
{
    const bool byAddress = creation.address != 0;
    const AddressMap::Location at = byAddress
                                        ? device.buffers.addresses.find(creation.address)
                                        : AddressMap::Location{.buffer = creation.buffer, .offset = creation.offset};
    auto structure = std::make_shared<ValidatedStructure>();
    structure->handle = handle;
    device.objects.destroyed.remove(handle);
    device.driver.report().beginName(handle.handle);
    structure->number = ++device.numbers;
    structure->type = type;
    structure->createFlags = flags;
    structure->record = device.records.take();
    structure->buffer = device.objects.buffers.get(at.buffer);
    structure->offset = at.offset;
    structure->size = creation.size;
    structure->ownAllocator = ownAllocator;
    structure->byAddress = byAddress;
    if (byAddress)
        structure->memoryAddress = creation.address;
    else if (structure->buffer && structure->buffer->address)
        structure->memoryAddress = structure->buffer->address + at.offset;
    if (structure->buffer)
        structure->buffer->structures.add(structure);
    if (handle.type == VK_OBJECT_TYPE_MICROMAP_EXT) {
        device.objects.micromaps.set(reinterpret_cast<VkMicromapEXT>(handle.handle), std::move(structure));
        return;
    }
    device.objects.byMemory.add(structure);
    device.objects.structures.set(reinterpret_cast<VkAccelerationStructureKHR>(handle.handle), std::move(structure));
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
    remember(device.objects, [&] {
        device.objects.lost.add(structure, {++device.numbers, structure.handle, how, device.nameOf(structure.handle)});
    });
    if (structure.record)
        remember(device.objects, [&] { device.records.setDestroyed(*structure.record); });
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

// A command that destroys a micromap or a structure.
struct Destruction {
    const char *command, *member;
    const char *parameter;      // it exists
    const char *unused;         // commands that refer to it are complete
    const char *lacksAllocator; // there are allocation callbacks, if there were when it was created
    const char *hasAllocator;   // there are no others
};
constexpr Destruction kMicromap{"vkDestroyMicromapEXT",
                                "micromap",
                                "VUID-vkDestroyMicromapEXT-micromap-parameter",
                                "VUID-vkDestroyMicromapEXT-micromap-07441",
                                "VUID-vkDestroyMicromapEXT-micromap-07442",
                                "VUID-vkDestroyMicromapEXT-micromap-07443"};
constexpr Destruction kStructure{"vkDestroyAccelerationStructureKHR",
                                 "accelerationStructure",
                                 "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-parameter",
                                 "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02442",
                                 "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02443",
                                 "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02444"};

// Checks it, and takes the structure out of the model. `allocator`: allocation callbacks are given. Returns whether it
// is passed on.
template <typename Handle>
bool destroy(DeviceValidation &device, Handle handle, HandleMap<Handle, std::shared_ptr<ValidatedStructure>> &known,
             const Destruction &ids, bool allocator)
{
    if (isDestroyed(device, handle, ids.command, ids.member, ids.parameter))
        return false;
    const auto structure = known.take(handle);
    if (!structure)
        return true;
    const Place command(ids.command);
    const InputCheck check = device.at(command, structure->handle);
    if (device.checks.core && !allocator && structure->ownAllocator)
        check.report(ids.lacksAllocator, "pAllocator", "it is null; the object was created with allocation callbacks");
    if (device.checks.core && allocator && !structure->ownAllocator)
        check.report(ids.hasAllocator, "pAllocator",
                     "it is not null; the object was created without allocation callbacks");
    checkUnused(device, ids.command, ids.unused, *structure);
    structure->destroyed = true;
    remember(device.objects, [&] { device.objects.destroyed.add(structure->handle); });
    setLost(device, *structure, "was destroyed");
    remember(device.objects, [&] { device.driver.report().endName(structure->handle.handle); });
    return true;
}

// The structures of a buffer that was destroyed or lost its memory.
void loseStructures(DeviceValidation &device, const ValidatedBuffer &buffer, const char *how)
{
    buffer.structures.visit([&](const std::shared_ptr<ValidatedStructure> &structure) {
        if (!structure->destroyed && lacksMemory(device, *structure))
            setLost(device, *structure, how);
    });
}

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

input::Creation checkCreation(DeviceValidation &device, const VkMicromapCreateInfoEXT &info)
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

input::Creation checkCreation(DeviceValidation &device, const VkAccelerationStructureCreateInfoKHR &info)
{
    const Place command("vkCreateAccelerationStructureKHR");
    const Place place = command.member("pCreateInfo");
    const auto buffer = device.objects.buffers.get(info.buffer);
    return rules::checkCreation(device.at(place, info.buffer), info, buffer ? buffer->size : UINT64_MAX);
}

input::Creation checkCreation(DeviceValidation &device, const VkAccelerationStructureCreateInfo2KHR &info)
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
    ranges::checkCreation(device, info);
    return creation;
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
    if (created == VK_SUCCESS)
        remember(device.objects,
                 [&] { addStructure(device, *result, info->type, creation, info->createFlags, allocator != nullptr); });
    return created;
}

VkResult createAccelerationStructure2(DeviceValidation &device, VkDevice handle,
                                      const VkAccelerationStructureCreateInfo2KHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    input::Creation creation = checkCreation(device, *info);
    const input::Checked checked(info, creation);
    const VkResult created = device.next.CreateAccelerationStructure2KHR(handle, info, allocator, result);
    if (created == VK_SUCCESS)
        remember(device.objects,
                 [&] { addStructure(device, *result, info->type, creation, info->createFlags, allocator != nullptr); });
    return created;
}

void destroyAccelerationStructure(DeviceValidation &device, VkDevice handle, VkAccelerationStructureKHR structure,
                                  const VkAllocationCallbacks *allocator)
{
    if (!destroy(device, structure, device.objects.structures, kStructure, allocator != nullptr))
        return;
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
            addStructure(device, *result, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR, creation,
                         info->createFlags, allocator != nullptr);
        });
    return created;
}

void destroyMicromap(DeviceValidation &device, VkDevice handle, VkMicromapEXT micromap,
                     const VkAllocationCallbacks *allocator)
{
    if (device.checks.core)
        checkFeature(device.at(Place(kMicromap.command)), "VUID-vkDestroyMicromapEXT-micromap-11619");
    if (destroy(device, micromap, device.objects.micromaps, kMicromap, allocator != nullptr))
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
