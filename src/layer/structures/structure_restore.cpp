// Deserialization of acceleration structures (core/records.h). What comes from the application's memory goes through
// shaders, which know where it ends and believe nothing; the driver reads memory of the layer's.
//
// What data holds is written in it, and what a structure of type GENERIC is made for is not: its handle may have any
// size. So everything is recorded that data can need, and the device lets one way have an effect.
#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "core/records.h"
#include "layer/micromaps/micromap.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"
#include "layer/structures/serialized_data.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr const char *kCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";
constexpr uint32_t kPlanDescriptorWord = 8; // shaders/serialized.glsl

struct Restore {
    DeviceStructures &device;
    VkCommandBuffer commandBuffer;
    VkDeviceAddress data;
    AccelerationStructure *target;
    CommandState *state;

    [[nodiscard]] VkDeviceSize readable() const { return device.buffers.addresses.bytesFrom(data); }

    // Of any bottom-level structure.
    [[nodiscard]] VkDeviceSize leastBytes() const { return fallbackStructure(device).structureBytes; }

    // kDescriptor*: kDescriptorUnbuilt where only the data tells. A small structure cannot become a bottom-level one.
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
        return inputCheck(device.driver, kCommand, target->handle).reject(id, text);
    }

    // Whether the back end can do it at all.
    [[nodiscard]] bool possible() const
    {
        if (fallbackStructure(device).units == 0) {
            device.driver.report().notAvailable(std::string(kCommand) + ", since the driver's serialized data could "
                                                                        "not be looked at,");
            return false;
        }
        // There is no memory even for what stands in for rejected data.
        return kind() != kDescriptorBottom || target->size >= leastBytes() ||
               reject("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746",
                      "dst is smaller than any deserialized structure");
    }

    // The instances of the data, by its header: what the host can see of it, and where it is there already. A build for
    // more would take more of the memory that a GENERIC structure reaches over than the header names.
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

    // The instances that the data can hold and the structure has room for; a GENERIC one, up to the next one in the
    // buffer, and not so many that structures that will never hold instances use up the slots.
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
        work.barrier();
    }

    void record() const
    {
        const StructureDescriptor descriptor = descriptorOf(device.objects, *target);
        if (kind() == kDescriptorMicromap) {
            becomeMicromap(device.objects, *target);
            return recordMicromapRestore(device.micromaps, commandBuffer, micromapIn(*target), data);
        }
        const bool top = kind() == kDescriptorTop;
        const uint32_t most = kind() == kDescriptorBottom ? 0 : mostInstances();
        const VkDeviceSize fallbackBytes = leastBytes();
        const VkDeviceSize stagingBytes = top ? 0
                                              : std::max(VkDeviceSize{fallbackStructure(device).units} * 16,
                                                         std::min(readable(), target->size + kDriverOverhead));
        // What a way that turns out to be the wrong one overwrites.
        VkDeviceSize keptBytes = 0;
        bool topFits = false;
        if (kind() == kDescriptorUnbuilt) {
            const VkDeviceSize topBytes = TopLevelLayout(device.driver, 0, most).bytes();
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
                push.topPath = 0; // data of that kind is refused
                recordCheck(work, push);
            }
            dispatch(work, push, kPassGiveBack, keptBytes);
            dispatch(work, push, kPassStage, target->size);
            recordDriver(work, push);
            dispatch(work, push, kPassGiveBackLast, leastBytes());
            dispatch(work, push, kPassFinish, target->size);
            work.barrier(true); // the host looks at the descriptor
        }
        if (mayBeMicromap()) {
            publishMicromap(device.objects, *target);
            recordMicromapRestore(device.micromaps, commandBuffer, micromapIn(*target), data,
                                  DataThatIsNone::LeavesTheTarget);
        }
        becomesUnknown(*target, push.serial);
    }

    bool recordTop(InjectedWork &work, const StructureRestorePush &push, uint32_t most) const
    {
        return recordTopLevelCopy(work, device, commandBuffer, kCommand, *target,
                                  push.staging + VkDeviceSize{kPlanDescriptorWord} * 4,
                                  TopLevelLayout(device.driver, 0, most), kFromSerialized);
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

void EmulatedBackend::recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy)
{
    AccelerationStructure &target = *copy.structure;
    if (isLayerObject(target)) {
        becomeMicromap(device_.objects, target);
        return recordMicromapRestore(device_.micromaps, commandBuffer, micromapIn(target), copy.data);
    }
    const auto state = device_.commands.states.get(commandBuffer);
    const Restore restore{device_, commandBuffer, copy.data, &target, state};
    if (restore.possible())
        restore.record();
}

} // namespace vellum::layer
