// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/objects.h"

#include <algorithm>

#include "layer/validation/model/device_model.h"

namespace vellum::layer
{
namespace
{

// Addresses of structures that may hold micromaps, which are remembered after the structures.
constexpr size_t kMostAddresses = size_t{1} << 20;

} // namespace

bool mayBeDiscardable(const DeviceModel &device, const ValidatedStructure &micromap)
{
    const auto &contents = micromap.contents;
    const bool isDrivers = !device.emulated && micromap.handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
    return contents && (contents->discardable || (isDrivers && contents->deserialized));
}

void addUse(ReferredObject &object, const Submission &submission, CommandUse use)
{
    if (submission.batch == 0)
        return;
    use.queue = submission.queue;
    use.batch = submission.batch;
    const auto known = std::ranges::find(object.uses, use.queue, &CommandUse::queue);
    if (known == object.uses.end())
        object.uses.push_back(use);
    else if (known->batch <= use.batch)
        *known = use;
}

void setContents(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure,
                 std::shared_ptr<const StructureContents> contents)
{
    structure->contents = std::move(contents);
    structure->overwrittenBy = {};
    structure->losses = 0;
    structure->since = structure->built = ++device.numbers;
    ++device.objects.constructions;
    if (!structure->contents)
        return;
    const auto before = device.objects.constructed.set(structure);
    if (!before || before->destroyed)
        return;
    if (!before->isMicromap()) { // programs use acceleration structures by any handle to their memory
        before->contents = unknownContents(before->type);
        return;
    }
    const bool isDiscardable = mayBeDiscardable(device, *before);
    before->contents = nullptr;
    before->overwrittenBy = structure->handle;
    if (!isDiscardable)
        device.objects.lost.add(*before, {structure->since, before->handle, "was overwritten by another structure",
                                          device.nameOf(before->handle)});
}

void setAttached(ValidatedStructure &micromap, bool isOrdered)
{
    if (micromap.contents)
        micromap.contents->isAttached = true;
    if (!isOrdered)
        micromap.mayBeAttached = true;
}

void setReference(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure, VkDeviceAddress address)
{
    if (structure->referenceAddress.exchange(address) == address)
        return;
    device.objects.byReference.add(address, structure);
    if (structure->record)
        device.records.setReference(address, *structure->record);
    else
        device.records.setIncomplete();
}

void findReference(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure)
{
    if (!device.checks.gpu || !structure || structure->isMicromap() || structure->referenceAddress != 0 ||
        lacksMemory(device, *structure) || !structure->buffer ||
        (structure->buffer->usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) == 0) // it has no address
        return;
    const VkAccelerationStructureDeviceAddressInfoKHR info{
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR, nullptr,
        reinterpret_cast<VkAccelerationStructureKHR>(structure->handle.handle)};
    setReference(device, structure, device.next.GetAccelerationStructureDeviceAddressKHR(device.driver.handle, &info));
}

std::string isNotConstructed(const DeviceModel &device, const ValidatedStructure &structure)
{
    if (structure.destroyed)
        return "it was destroyed";
    if (const char *lacks = lacksMemory(device, structure))
        return lacks;
    // Another handle to the memory may have been built; programs use acceleration structures by any of them.
    if (structure.contents || (!structure.isMicromap() &&
                               (device.driver.enabled.otherStructures || device.objects.constructed.wasAt(structure))))
        return {};
    return structure.overwrittenBy ? device.nameOf(structure.overwrittenBy) + " was built in its memory since"
                                   : "it was never built";
}

ConstructedStructures::Location ConstructedStructures::locationOf(const ValidatedStructure &structure)
{
    const ValidatedBuffer *buffer = structure.buffer.get();
    return buffer && buffer->memory ? Location{buffer->memory.load(), buffer->memoryOffset + structure.offset}
                                    : Location{};
}

std::shared_ptr<ValidatedStructure> ConstructedStructures::set(const std::shared_ptr<ValidatedStructure> &structure)
{
    const Location location = locationOf(*structure);
    if (!location.first)
        return nullptr;
    if (structures_.size() == kMost) {
        structures_.clear();
        forgot_ = true;
    }
    auto &there = structures_[location];
    const auto before = there.lock();
    there = structure;
    return before == structure ? nullptr : before;
}

bool ConstructedStructures::wasAt(const ValidatedStructure &structure) const
{
    const Location location = locationOf(structure);
    return forgot_ || !location.first || structures_.contains(location);
}

void ConstructedStructures::forget(VkDeviceMemory memory)
{
    structures_.erase(structures_.lower_bound({memory, 0}), structures_.upper_bound({memory, UINT64_MAX}));
}

void LostStructures::add(const ValidatedStructure &structure, const Loss &loss)
{
    const std::lock_guard lock(mutex_);
    const VkDeviceAddress reference = structure.referenceAddress;
    Losses &losses = structure.isMicromap() ? numbers_ : references_;
    if (!structure.isMicromap() && reference == 0)
        return; // no instance names it
    if (losses.size() == kMost)
        losses.clear();
    Loss &known = losses[structure.isMicromap() ? structure.number : reference];
    if (known.number <= structure.since || known.handle.handle != loss.handle.handle)
        known = loss;
    ++count_;
}

void StructuresByAddress::add(VkDeviceAddress address, const std::shared_ptr<ValidatedStructure> &structure)
{
    if (structures_.size() >= sweepAt_) {
        std::erase_if(structures_, [](const auto &known) { return known.second.expired(); });
        sweepAt_ = std::max<size_t>(64, 2 * structures_.size());
    }
    structures_.emplace(address, structure);
}

void StructuresByReference::add(VkDeviceAddress reference, const std::shared_ptr<ValidatedStructure> &structure)
{
    const std::lock_guard lock(mutex_);
    structures_.add(reference, structure);
}

std::shared_ptr<ValidatedStructure> StructuresByReference::at(VkDeviceAddress reference) const
{
    const std::lock_guard lock(mutex_);
    std::shared_ptr<ValidatedStructure> last;
    structures_.visit(reference, [&](const auto &structure) {
        const auto isValid = [](const ValidatedStructure &one) { return !one.destroyed && one.contents; };
        if (!last || !isValid(*last) || isValid(*structure))
            last = structure;
    });
    return last;
}

std::shared_ptr<ValidatedStructure> StructuresByReference::onlyAt(VkDeviceAddress reference) const
{
    const std::lock_guard lock(mutex_);
    std::shared_ptr<ValidatedStructure> only;
    size_t count = 0;
    structures_.visit(reference, [&](const auto &structure) {
        if (structure->destroyed)
            return;
        only = structure;
        ++count;
    });
    return count == 1 ? only : nullptr;
}

void StructuresByMemory::add(const std::shared_ptr<ValidatedStructure> &structure)
{
    if (!structure->isMicromap() && structure->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        return;
    const std::lock_guard lock(mutex_);
    structures_.add(structure->memoryAddress, structure);
    isFull_ = isFull_ || addresses_.size() == kMostAddresses;
    if (!isFull_)
        addresses_.insert(structure->memoryAddress);
}

std::vector<std::shared_ptr<ValidatedStructure>> StructuresByMemory::at(VkDeviceAddress address) const
{
    const std::lock_guard lock(mutex_);
    std::vector<std::shared_ptr<ValidatedStructure>> found;
    structures_.visit(address, [&](const auto &structure) {
        if (!structure->destroyed &&
            (structure->isMicromap() || !structure->contents ||
             structure->contents->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR ||
             structure->contents->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR))
            found.push_back(structure);
    });
    return found;
}

bool StructuresByMemory::everAt(VkDeviceAddress address) const
{
    const std::lock_guard lock(mutex_);
    return isFull_ || addresses_.contains(address);
}

bool StructuresByMemory::isComplete() const
{
    const std::lock_guard lock(mutex_);
    bool complete = true;
    structures_.visit(0, [&](const auto &) { complete = false; });
    return complete;
}

std::shared_ptr<ValidatedStructure> ValidatedObjects::structureOf(ObjectHandle handle) const
{
    if (!handle)
        return nullptr;
    return handle.type == VK_OBJECT_TYPE_MICROMAP_EXT
               ? micromaps.get(reinterpret_cast<VkMicromapEXT>(handle.handle))
               : structures.get(reinterpret_cast<VkAccelerationStructureKHR>(handle.handle));
}

std::shared_ptr<StructureContents> unknownContents(VkAccelerationStructureTypeKHR type)
{
    auto contents = std::make_shared<StructureContents>();
    contents->type = type;
    contents->deserialized = true;
    return contents;
}

const char *lacksMemory(const DeviceModel &device, const ValidatedStructure &structure)
{
    const ValidatedBuffer *buffer = structure.buffer.get();
    if (structure.byAddress)
        return device.rules.lacksBuffer(structure.memoryAddress) ? "no buffer has its address any more" : nullptr;
    if (!buffer)
        return nullptr;
    if (buffer->destroyed)
        return "its buffer was destroyed";
    if (buffer->memoryFreed)
        return "its memory was freed";
    const bool isSparse = (buffer->flags & VK_BUFFER_CREATE_SPARSE_BINDING_BIT) != 0;
    return buffer->memory || isSparse ? nullptr : "its buffer is not bound to device memory";
}

MemoryRange memoryIn(const ValidatedBuffer *buffer, VkDeviceSize offset, VkDeviceSize size)
{
    if (!buffer || !buffer->memory || offset >= buffer->size)
        return {};
    const VkDeviceSize begin = buffer->memoryOffset + offset;
    return {uint64_t(buffer->memory.load()), begin, begin + std::min(size, buffer->size - offset)};
}

std::shared_ptr<ValidatedBuffer> bufferAt(const DeviceModel &device, VkDeviceAddress address)
{
    const AddressMap::Location location = device.buffers.addresses.find(address);
    return location.buffer ? device.objects.buffers.get(location.buffer) : nullptr;
}

ObjectFacts DeviceModel::factsOf(ObjectHandle handle) const
{
    const auto structure = objects.structureOf(handle);
    if (!structure)
        return {.exists = handle && objects.anyUnknown,
                .destroyed = handle && objects.destroyed.contains(handle),
                .size = UINT64_MAX};
    ObjectFacts found{.exists = true,
                      .type = structure->isMicromap() ? VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR
                                                      : structure->type,
                      .size = structure->size};
    found.content = found.type;
    if (found.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR && rules.content)
        found.content = rules.content(handle);
    found.lacksMemory = lacksMemory(*this, *structure);
    if (const ValidatedBuffer *buffer = structure->buffer.get())
        found.hostVisible = buffer->memory && objects.memories.get(buffer->memory).hostVisible;
    return found;
}

} // namespace vellum::layer
