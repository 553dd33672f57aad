// SPDX-License-Identifier: Apache-2.0
#include "layer/state/acceleration_structure.h"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <utility>

#include "core/records.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// Makes the structure's address lead to the location's descriptor, with the location's mutex held. Naming one structure
// of a location names all of them: when one is destroyed the buffer may be gone, and the driver has no addresses any
// more.
void addReference(DeviceState &device, StructureLocation &location, AccelerationStructure &structure)
{
    if (structure.reference != 0 || isLayerObject(structure))
        return;
    const VkDeviceAddress address = device.driver.structureAddress(structure.handle);
    const auto known = std::ranges::find(location.references, address, &StructureLocation::Reference::address);
    if (known != location.references.end()) {
        ++known->structures;
    } else {
        location.references.reserve(location.references.size() + 1); // before the root knows the address
        if (!location.descriptor.address) {
            location.descriptor = device.root.acquireDescriptor(address);
            if (!location.descriptor.address)
                return;
        } else {
            const VkDeviceAddress leads =
                location.references.empty() ? location.heldKey : location.references.front().address;
            if (!device.root.addReference(address, leads))
                return; // the next call tries again
        }
        location.references.push_back({address, 1});
    }
    structure.reference = address;
}

// A structure with that address was destroyed. If it was the last one, the driver may reuse the address for a structure
// at another location, with another descriptor. The descriptor of this location stays for its other structures, whose
// own addresses lead to it.
void forgetReference(DeviceState &device, StructureLocation &location, VkDeviceAddress address)
{
    const auto gone = std::ranges::find(location.references, address, &StructureLocation::Reference::address);
    if (--gone->structures > 0)
        return;
    if (location.references.size() == 1 && location.heldKey == 0)
        location.heldKey = device.root.holdDescriptor(address);
    if (location.references.size() == 1 && location.heldKey == 0)
        return; // no memory
    device.root.releaseDescriptor(address);
    location.references.erase(gone);
}

} // namespace

std::shared_ptr<AccelerationStructure> newStructure(const BufferRange &range, VkAccelerationStructureTypeKHR type)
{
    auto structure = std::make_shared<AccelerationStructure>();
    structure->buffer = range.buffer;
    structure->offset = range.offset;
    structure->size = range.size;
    structure->bufferOwner = range.owner;
    structure->type = type;
    return structure;
}

void enterLocation(DeviceState &device, AccelerationStructure &structure)
{
    const StructureLocations::Key key{device.buffers.infos.get(structure.buffer).number, structure.offset};
    structure.position = device.locations.acquire(key, [&](StructureLocation &location, bool isNew) {
        structure.location = &location;
        std::unique_lock lock(location.mutex, std::defer_lock);
        if (!isNew)
            lock.lock();
        if (location.descriptor.address)
            addReference(device, location, structure);
        structure.nextAtLocation = std::exchange(location.first, &structure);
        structure.linkAtLocation = &location.first;
        if (structure.nextAtLocation)
            structure.nextAtLocation->linkAtLocation = &structure.nextAtLocation;
    });
}

void leaveLocation(DeviceState &device, const AccelerationStructure &structure)
{
    // The last structure destroys the location, with everything that leads to it.
    device.locations.release(structure.position, [&](StructureLocation &location) {
        std::lock_guard lock(location.mutex);
        *structure.linkAtLocation = structure.nextAtLocation;
        if (structure.nextAtLocation)
            structure.nextAtLocation->linkAtLocation = structure.linkAtLocation;
        if (structure.reference != 0)
            forgetReference(device, location, structure.reference);
    });
}

StructureDescriptor descriptorOf(DeviceState &device, AccelerationStructure &structure)
{
    StructureLocation &location = *structure.location;
    std::lock_guard lock(location.mutex);
    if (structure.reference == 0) {
        addReference(device, location, structure);
        for (AccelerationStructure *other = location.first; other; other = other->nextAtLocation)
            addReference(device, location, *other);
    }
    return location.descriptor;
}

namespace
{

// Takes over what the device has found in deserialized data. False if it has not executed the copy. The device, which
// may be executing it, writes the serial last; the kind decides where the serial is.
bool takeDeserialized(StructureLocation &location)
{
    const auto word = [&location](uint32_t i) {
        return __atomic_load_n(location.descriptor.words + i, __ATOMIC_ACQUIRE);
    };
    const uint32_t kind = word(2) & kDescriptorKindMask;
    if (word(kind == kDescriptorBoxes ? 6 : 7) != location.deserialization || (word(2) & kDescriptorKindMask) != kind)
        return false;
    switch (kind) {
    case kDescriptorTop:
        location.content = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
        location.lastInstances = location.mostInstances = word(4);
        break;
    case kDescriptorMicromap: location.content = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR; break;
    default: location.content = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR; break;
    }
    return true;
}

// The location's mutex must be locked.
void setContent(StructureLocation &location, VkAccelerationStructureTypeKHR type, VkDeviceSize bytes)
{
    location.content = type;
    location.lastBytes = bytes;
    location.deserialization = 0;
}

// The type that the size of a structure is marked for, if a query or the header of serialized data returned it.
VkAccelerationStructureTypeKHR markedType(VkDeviceSize size)
{
    switch (size % 256) {
    case kMicromapSizeMark: return VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    case kTopLevelSizeMark: return VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    default: return VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    }
}

} // namespace

VkAccelerationStructureTypeKHR contentOf(const Driver &driver, const AccelerationStructure &structure)
{
    constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    if (structure.type != kGeneric)
        return structure.type;
    const VkAccelerationStructureTypeKHR marked = markedType(structure.size);
    StructureLocation &location = *structure.location;
    std::lock_guard lock(location.mutex);
    if (location.deserialization != 0 && !takeDeserialized(location))
        return marked;
    const bool markedMicromap = driver.translated() && marked == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    return location.content == kGeneric && markedMicromap ? marked : location.content;
}

void becomesUnknown(AccelerationStructure &structure, uint32_t deserialization)
{
    StructureLocation &location = *structure.location;
    std::lock_guard lock(location.mutex);
    setContent(location, VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR, 0);
    location.lastInstances = location.mostInstances = 0;
    location.deserialization = deserialization;
}

void becomes(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, VkDeviceSize bytes)
{
    std::lock_guard lock(structure.location->mutex);
    setContent(*structure.location, type, bytes);
}

void becomesStructure(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, bool namesMicromaps)
{
    // A type that only the device knows is a type of the driver, and not a micromap.
    becomes(structure,
            type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ? VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR : type,
            0);
    std::lock_guard lock(structure.location->mutex);
    structure.location->namesMicromaps = namesMicromaps;
}

bool namesMicromaps(const AccelerationStructure &structure)
{
    std::lock_guard lock(structure.location->mutex);
    return structure.location->namesMicromaps;
}

VkDeviceSize lastBytes(const AccelerationStructure &structure)
{
    std::lock_guard lock(structure.location->mutex);
    return structure.location->lastBytes;
}

void becomesTopLevel(AccelerationStructure &structure, uint32_t instances, VkDeviceSize bytes)
{
    StructureLocation &location = *structure.location;
    std::lock_guard lock(location.mutex);
    setContent(location, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, bytes);
    location.lastInstances = instances;
    location.mostInstances = std::max(location.mostInstances, instances);
}

VkDeviceSize capacityOf(const DeviceState &device, const AccelerationStructure &structure)
{
    return std::min(structure.size, device.locations.bytesToNext(structure.position));
}

namespace
{

// Returns outgrown slots that no command can access any more, with the location's mutex held. If no command buffer uses
// them, all builds with them were executed before or never will be, and the host sees what they have written to the
// descriptor (InjectedWork::barrier). Work that used the content before it was replaced is complete, too, since builds
// wait for it.
void returnOutgrownSlots(StructureLocation &location)
{
    const uint32_t *words = location.descriptor.words;
    std::erase_if(location.outgrownSlots, [words](const std::shared_ptr<SlotRange> &slots) {
        // Each count is read without an order. Who released the slots may have taken them into use before.
        if (slots.use_count() > 1)
            return false;
        std::atomic_thread_fence(std::memory_order_acquire);
        if (slots->isUsed())
            return false;
        std::atomic_thread_fence(std::memory_order_acquire);
        const bool inUse = words &&
                           (__atomic_load_n(words + 2, __ATOMIC_RELAXED) & kDescriptorKindMask) == kDescriptorTop &&
                           __atomic_load_n(words + kDescriptorFirstSlot, __ATOMIC_RELAXED) == slots->first();
        return !inUse;
    });
}

} // namespace

std::shared_ptr<SlotRange> slotsFor(DeviceState &device, AccelerationStructure &structure, uint32_t count)
{
    StructureLocation &location = *structure.location;
    std::lock_guard lock(location.mutex);
    std::shared_ptr<SlotRange> &slots = location.slots;
    if (slots && slots->count() >= count)
        return slots;
    returnOutgrownSlots(location);
    // Half as many more, so that a growing structure rarely gets others.
    const uint32_t had = slots ? slots->count() : 0;
    for (const uint32_t wanted : {std::max(count, had + had / 2), count}) {
        if (auto others = device.root.allocateSlots(wanted)) {
            if (slots)
                location.outgrownSlots.push_back(std::move(slots));
            return slots = std::move(others);
        }
    }
    return nullptr;
}

VkDeviceAddress beginOf(const Driver &driver, const AccelerationStructure &structure)
{
    return driver.bufferAddress(structure.buffer) + structure.offset;
}

uint32_t unitsOf(VkDeviceSize bytes)
{
    return static_cast<uint32_t>(std::min<VkDeviceSize>(bytes / 16, UINT32_MAX));
}

bool canHoldMicromap(const AccelerationStructure &structure)
{
    return structure.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR ||
           structure.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
}

std::optional<bool> holdsMicromap(const Driver &driver, const AccelerationStructure &structure)
{
    const VkAccelerationStructureTypeKHR content = contentOf(driver, structure);
    return content == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR
               ? std::nullopt
               : std::optional(content == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
}

Micromap micromapIn(const AccelerationStructure &structure)
{
    return {structure.buffer,
            structure.offset,
            structure.size,
            {VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(structure.handle)}};
}

bool publishesMicromap(const DeviceState &device, const AccelerationStructure &structure)
{
    return device.driver.enabled.khr && canHoldMicromap(structure);
}

void publishMicromap(DeviceState &device, AccelerationStructure &structure)
{
    if (!publishesMicromap(device, structure))
        return;
    std::lock_guard lock(structure.mutex);
    if (!structure.micromapKey)
        structure.micromapKey = device.root.acquireMicromap(beginOf(device.driver, structure), structure.size);
}

void publishMicromapOnceBound(DeviceState &device, const std::shared_ptr<AccelerationStructure> &structure)
{
    if (!publishesMicromap(device, *structure))
        return;
    {
        // The mutex: bufferHasAddress() comes after the address is known, and only once.
        std::lock_guard lock(device.unboundMutex);
        if (device.buffers.addresses.addressOf(structure->buffer) == 0)
            return static_cast<void>(device.unboundMicromaps.emplace(structure->buffer, structure));
    }
    publishMicromap(device, *structure);
}

void bufferHasAddress(DeviceState &device, VkBuffer buffer)
{
    std::lock_guard lock(device.unboundMutex);
    const auto [first, last] = device.unboundMicromaps.equal_range(buffer);
    for (auto at = first; at != last; ++at) {
        if (const auto structure = at->second.lock())
            publishMicromap(device, *structure);
    }
    device.unboundMicromaps.erase(first, last);
}

void becomeMicromap(DeviceState &device, AccelerationStructure &structure)
{
    publishMicromap(device, structure);
    becomes(structure, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR, 0);
}

StructureLocation::~StructureLocation()
{
    for (const Reference &reference : references)
        root.releaseDescriptor(reference.address);
    if (heldKey != 0)
        root.releaseDescriptor(heldKey);
}

VkDeviceSize StructureLocations::bytesToNext(Position position) const
{
    std::lock_guard lock(mutex_);
    const auto next = std::next(position);
    return next == locations_.end() || next->first.first != position->first.first
               ? ~VkDeviceSize{0}
               : next->first.second - position->first.second;
}

} // namespace vellum::layer
