// SPDX-License-Identifier: Apache-2.0
// Serialization and deserialization of acceleration structures with emulated micromaps (layouts: core/records.h). The
// driver reads and writes memory of the layer; shaders move the data to and from the application's memory, because they
// know where its buffer ends, and check everything that they read there.
//
// The data states what it holds. A structure of type GENERIC does not state what it was made for: its handle may have
// any size. For such a target everything is recorded that the data can need, and the device decides which of it has an
// effect.
#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string>

#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/ids.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr VkDeviceSize kPlanBytes =
    256; // before the driver's data in staging memory: shaders/structures/serialized.glsl
constexpr uint32_t kPlanDescriptorWord = 8;                           // in the plan
static_assert(kPlanDescriptorWord * 4 % kDescriptorGenerations == 0); // its address has no generation
// Bytes that the driver's serialized data has more than the structure, at most; 56 on known drivers.
constexpr VkDeviceSize kDriverOverhead = 65536;

// --- serialization ---

constexpr uint32_t kUuidWords = 2 * VK_UUID_SIZE / 4;

void saveTopLevel(InjectedWork &work, DeviceStructures &device, const AccelerationStructure &source,
                  VkDeviceAddress descriptor, VkDeviceAddress target)
{
    TopSavePush push{};
    push.descriptor = descriptor;
    push.begin = beginOf(device.driver, source);
    push.blob = target;
    push.root = device.objects.root.address();
    push.fallback = fallbackStructure(device).address;
    push.structureUnits = unitsOf(source.size);
    push.leastUnits = unitsOf(TopLevelLayout(device.driver, kTopLevelCopyFlags, 0).tailOffset);
    push.capacity = unitsOf(device.buffers.addresses.bytesFrom(target));
    for (push.pass = 0; push.pass < 2; ++push.pass) {
        work.dispatch(InjectedShader::TopSave, push, push.pass == 0 ? 1 : copyInvocations(source.size), 64);
        work.barrier(true); // the host reads the counters of errors
    }
}

void saveBottomLevel(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer, CommandState &state,
                     AccelerationStructure &source, VkDeviceAddress descriptor, VkDeviceAddress target)
{
    const VkAccelerationStructureKHR exact = exactSizeHandle(device, source);
    const FallbackFacts fallback = fallbackStructure(device);
    VkDeviceSize stagingBytes = exact == source.handle ? source.size : lastBytes(source);
    // The size of a GENERIC structure states nothing. The data of the driver is a part of that of the layer, for which
    // there must be memory at `target`.
    if (source.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR && !fallback.wholeCopies)
        stagingBytes = std::min(stagingBytes, device.buffers.addresses.bytesFrom(target));
    stagingBytes += kDriverOverhead;
    state.scratch.restart();
    const VkDeviceAddress staging = state.scratch.allocate(kPlanBytes + stagingBytes);
    if (!staging) {
        rejectCommand(device.driver, "vkCmdCopyAccelerationStructureToMemoryKHR", source.handle, "VELLUM-out-of-memory",
                      "no memory for the driver's serialized data");
        return;
    }
    VkCopyAccelerationStructureToMemoryInfoKHR driverInfo{
        VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
    driverInfo.src = exact;
    driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    driverInfo.dst.deviceAddress = staging + kPlanBytes;
    device.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &driverInfo);
    work.barrier();
    StructureSavePush push{};
    push.descriptor = descriptor;
    push.begin = beginOf(device.driver, source);
    push.staging = staging;
    push.blob = target;
    push.root = device.objects.root.address();
    push.structureUnits = unitsOf(source.size);
    push.stagingUnits = unitsOf(stagingBytes);
    push.leastUnits = unitsOf(fallback.structureBytes);
    push.capacity = unitsOf(device.buffers.addresses.bytesFrom(push.blob));
    push.wholeCopies = fallback.wholeCopies;
    push.blocks = device.driver.enabled.khr;
    for (push.pass = 0; push.pass < 2; ++push.pass) {
        work.dispatch(InjectedShader::StructureSave, push, push.pass == 0 ? 1 : copyInvocations(source.size), 64);
        work.barrier(true); // the host reads the counters of errors
    }
}

// --- deserialization ---

constexpr const char *kRestoreCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";

struct Restore {
    DeviceStructures &device;
    VkCommandBuffer commandBuffer;
    VkDeviceAddress data;
    AccelerationStructure *target;
    CommandState *state;

    [[nodiscard]] VkDeviceSize readable() const { return device.buffers.addresses.bytesFrom(data); }

    // The least size of a bottom-level structure.
    [[nodiscard]] VkDeviceSize leastBytes() const { return fallbackStructure(device).structureBytes; }

    // The expected content, kDescriptor*; kDescriptorUnbuilt: only the data states it. A small structure cannot become
    // a bottom-level one.
    [[nodiscard]] uint32_t kind() const
    {
        switch (target->type) {
        case VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR: return kDescriptorTop;
        case VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR: return kDescriptorBottom;
        default: break;
        }
        if (target->size >= leastBytes())
            return kDescriptorUnbuilt;
        return mayBeMicromap() && target->size % 256 != kTopLevelSizeMark ? kDescriptorMicromap : kDescriptorTop;
    }
    [[nodiscard]] bool mayBeMicromap() const { return device.driver.enabled.khr && canHoldMicromap(*target); }

    bool reject(const char *id, const char *text) const
    {
        return rejectCommand(device.driver, kRestoreCommand, target->handle, id, text);
    }

    // Returns whether the deserialization can be recorded; reports why not.
    [[nodiscard]] bool check() const
    {
        if (fallbackStructure(device).units == 0) {
            device.driver.report().notAvailable(std::string(kRestoreCommand) +
                                                ", since the driver's serialized data could not be read,");
            return false;
        }
        // The memory must at least hold the fallback, which replaces rejected data.
        return kind() != kDescriptorBottom || target->size >= leastBytes() ||
               reject(rules::ids::kDeserializedSize, "dst is smaller than any deserialized structure");
    }

    // The number of instances in the header of the data, if the host can read it, and the data has already been
    // written. A build for more instances would use more of a GENERIC structure's memory than the header states.
    [[nodiscard]] std::optional<uint32_t> instancesInHeader() const
    {
        constexpr VkDeviceSize kBytes = kSerializedHeaderWords * 4;
        const AddressMap::Location location = device.buffers.addresses.find(data);
        if (!location.buffer || location.bytes < kBytes)
            return std::nullopt;
        std::array<uint32_t, kSerializedHeaderWords> words;
        if (!device.buffers.host.peek(location.buffer, location.offset, words.data(), kBytes))
            return std::nullopt;
        const uint32_t *fallback = fallbackStructure(device).words;
        for (uint32_t w = 0; w < 2 * VK_UUID_SIZE / 4; ++w) {
            if (words[w] != (w < VK_UUID_SIZE / 4 ? fallback[w] : fallback[w] ^ kCompatibilityWord))
                return std::nullopt;
        }
        return words[10] % 256 == kTopLevelSizeMark ? words[12] : 0;
    }

    // The maximum of instances: as many as the data can hold, and the structure's memory. The memory of a GENERIC
    // structure counts up to the next structure in the buffer, and the number is limited, so that structures that will
    // never hold instances do not use up the slots.
    [[nodiscard]] uint32_t mostInstances() const
    {
        constexpr uint32_t kMostUnseen = 4096;
        const bool generic = kind() == kDescriptorUnbuilt;
        if (const auto known = generic ? instancesInHeader() : std::nullopt)
            return std::min(topLevelCapacity(device.driver, target->size), *known);
        constexpr VkDeviceSize kLeast = sizeof(VkAccelerationStructureInstanceKHR) + sizeof(VkDeviceAddress);
        const VkDeviceSize inMemory = std::min<VkDeviceSize>(readable() / kLeast, UINT32_MAX);
        const VkDeviceSize capacity = generic ? capacityOf(device.objects, *target) : target->size;
        const uint32_t fits = std::min(topLevelCapacity(device.driver, capacity), static_cast<uint32_t>(inMemory));
        return generic ? std::min(fits, kMostUnseen) : fits;
    }

    [[nodiscard]] StructureRestorePush pushFor(VkDeviceAddress descriptor, VkDeviceSize stagingBytes) const
    {
        const FallbackFacts fallback = fallbackStructure(device);
        StructureRestorePush push{};
        push.blob = data;
        push.descriptor = descriptor;
        push.begin = beginOf(device.driver, *target);
        push.root = device.objects.root.address();
        push.fallback = fallback.address;
        push.fallbackUnits = fallback.units;
        push.capacity = unitsOf(readable());
        push.stagingUnits = unitsOf(stagingBytes);
        push.targetUnits = unitsOf(target->size);
        push.kind = kind();
        return push;
    }

    void dispatch(InjectedWork &work, StructureRestorePush &push, uint32_t pass, VkDeviceSize bytes) const
    {
        const bool one = pass == kPassCheck || pass == kPassDecide;
        push.pass = pass;
        work.dispatch(InjectedShader::StructureRestore, push, one ? 1 : copyInvocations(bytes), 64);
        work.barrier(pass == kPassFinish); // the host reads the descriptor and the counters of errors
    }

    void record() const
    {
        const StructureDescriptor descriptor = descriptorOf(device.objects, *target);
        if (kind() == kDescriptorMicromap) {
            becomeMicromap(device.objects, *target);
            return recordMicromapRestore(device.micromaps, commandBuffer, micromapIn(*target), data);
        }
        if (!InjectedWork(device.commands, commandBuffer).prepare(InjectedShader::StructureRestore))
            return; // the driver must not read staging memory that is not written
        const bool top = kind() == kDescriptorTop;
        const uint32_t most = kind() == kDescriptorBottom ? 0 : mostInstances();
        const VkDeviceSize fallbackBytes = leastBytes();
        const VkDeviceSize stagingBytes = top ? 0
                                              : std::max(VkDeviceSize{fallbackStructure(device).units} * 16,
                                                         std::min(readable(), target->size + kDriverOverhead));
        // Memory that the wrong one of the two paths overwrites.
        VkDeviceSize keptBytes = 0;
        bool topFits = false;
        if (kind() == kDescriptorUnbuilt) {
            const VkDeviceSize topBytes = TopLevelLayout(device.driver, kTopLevelCopyFlags, most).bytes();
            topFits = topBytes <= capacityOf(device.objects, *target);
            keptBytes = std::max(alignUp(fallbackBytes, 16), topFits ? topBytes : 0);
        }
        if (state)
            state->scratch.restart();
        StructureRestorePush push = pushFor(descriptor.address, stagingBytes);
        push.staging = state && descriptor.address ? state->scratch.allocate(kPlanBytes + stagingBytes) : 0;
        push.kept = push.staging && keptBytes > 0 ? state->scratch.allocate(keptBytes) : 0;
        if (!push.staging || (keptBytes > 0 && !push.kept)) {
            reject("VELLUM-out-of-memory", "no memory for the serialized data");
            return;
        }
        push.keptUnits = unitsOf(std::min(keptBytes, target->size));
        push.fallbackBuiltUnits = unitsOf(std::min(fallbackBytes, target->size));
        push.topPath = top || topFits;
        push.serial = ++device.objects.deserializations;
        if (push.serial == 0)
            push.serial = ++device.objects.deserializations;
        if (push.kind == kDescriptorUnbuilt)
            return recordEither(push, most, keptBytes);
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        recordCheck(work, push);
        if (top) {
            recordTop(work, push, most);
            return;
        }
        dispatch(work, push, kPassStage, target->size);
        recordDriver(work, push);
        dispatch(work, push, kPassFinish, target->size);
        becomes(*target, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, 0);
    }

    void recordCheck(InjectedWork &work, StructureRestorePush &push) const
    {
        dispatch(work, push, kPassCheck, target->size);
        dispatch(work, push, kPassAddUp, target->size);
        dispatch(work, push, kPassDecide, target->size);
    }

    void recordEither(StructureRestorePush &push, uint32_t most, VkDeviceSize keptBytes) const
    {
        {
            InjectedWork work(device.commands, commandBuffer);
            work.barrier();
            recordCheck(work, push);
            dispatch(work, push, kPassKeep, keptBytes);
            if (push.topPath != 0 && !recordTop(work, push, most)) {
                push.topPath = 0; // top-level data is then rejected
                recordCheck(work, push);
            }
            dispatch(work, push, kPassRestoreKept, keptBytes);
            dispatch(work, push, kPassStage, target->size);
            recordDriver(work, push);
            dispatch(work, push, kPassRestoreKeptLast, leastBytes());
            dispatch(work, push, kPassFinish, target->size);
        }
        if (mayBeMicromap()) {
            publishMicromap(device.objects, *target);
            recordMicromapRestore(device.micromaps, commandBuffer, micromapIn(*target), data, InvalidData::KeepsTarget);
        }
        becomesUnknown(*target, push.serial);
    }

    bool recordTop(InjectedWork &work, const StructureRestorePush &push, uint32_t most) const
    {
        return recordTopLevelCopy(work, device, commandBuffer, kRestoreCommand, *target,
                                  push.staging + VkDeviceSize{kPlanDescriptorWord} * 4,
                                  TopLevelLayout(device.driver, kTopLevelCopyFlags, most), kFromSerialized);
    }

    void recordDriver(InjectedWork &work, const StructureRestorePush &push) const
    {
        VkCopyMemoryToAccelerationStructureInfoKHR driverInfo{
            VK_STRUCTURE_TYPE_COPY_MEMORY_TO_ACCELERATION_STRUCTURE_INFO_KHR};
        driverInfo.dst = target->handle;
        driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        driverInfo.src.deviceAddress = push.staging + kPlanBytes;
        device.driver.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, &driverInfo);
        work.barrier();
    }
};

} // namespace

void EmulatedBackend::recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    AccelerationStructure &source = *copy.structure;
    if (copy.content == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return recordMicromapSave(device_.micromaps, commandBuffer, micromapIn(source), copy.data);
    const auto state = device_.commands.states.get(commandBuffer);
    const StructureDescriptor descriptor = descriptorOf(device_.objects, source);
    if (!state || !descriptor.address || fallbackStructure(device_).units == 0) {
        device_.driver.report().notAvailable(
            "vkCmdCopyAccelerationStructureToMemoryKHR without memory for the layer's tables,");
        return;
    }
    InjectedWork work(device_.commands, commandBuffer);
    work.barrier();
    if (copy.content == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR)
        saveTopLevel(work, device_, source, descriptor.address, copy.data);
    else
        saveBottomLevel(work, device_, commandBuffer, *state, source, descriptor.address, copy.data);
}

VkAccelerationStructureCompatibilityKHR
EmulatedBackend::compatibility(const VkAccelerationStructureVersionInfoKHR &info)
{
    const SerializedMicromapHeader micromap = serializedHeader(device_.driver.driverUuid, 0);
    if (device_.driver.enabled.khr && std::memcmp(info.pVersionData, &micromap, 2 * VK_UUID_SIZE) == 0)
        return VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
    // The driver decides whether it can read the data. Data of the driver alone is not compatible.
    uint32_t words[kUuidWords];
    std::memcpy(words, info.pVersionData, sizeof words);
    for (uint32_t w = VK_UUID_SIZE / 4; w < kUuidWords; ++w)
        words[w] ^= kCompatibilityWord;
    VkAccelerationStructureVersionInfoKHR driverInfo = info;
    driverInfo.pVersionData = reinterpret_cast<const uint8_t *>(words);
    VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
    device_.driver.next.GetDeviceAccelerationStructureCompatibilityKHR(device_.driver.handle, &driverInfo, &result);
    if (result != VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR)
        return result;
    const FallbackFacts fallback = fallbackStructure(device_);
    const bool same = fallback.units != 0 && std::memcmp(words, fallback.words, sizeof words) == 0;
    return same ? VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR
                : VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
}

void EmulatedBackend::recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    AccelerationStructure &target = *copy.structure;
    if (isLayerObject(target)) {
        becomeMicromap(device_.objects, target);
        return recordMicromapRestore(device_.micromaps, commandBuffer, micromapIn(target), copy.data);
    }
    const auto state = device_.commands.states.get(commandBuffer);
    const Restore restore{device_, commandBuffer, copy.data, &target, state};
    if (restore.check())
        restore.record();
}

} // namespace vellum::layer
