#include <algorithm>
#include <string>

#include "core/records.h"
#include "layer/translation/device_translation.h"
#include "layer/translation/placed_micromaps.h"
#include "layer/translation/translation.h"

namespace vellum::layer
{
namespace
{

constexpr VkAccelerationStructureTypeKHR kMicromap = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
constexpr VkAccelerationStructureTypeKHR kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;

Judge judgeOf(const DeviceTranslation &device, const char *command, VkAccelerationStructureKHR structure)
{
    return {device.driver.report(), command, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
            reinterpret_cast<uint64_t>(structure)};
}

struct Copy {
    DeviceTranslation &device;
    VkCommandBuffer commandBuffer;
    const VkCopyAccelerationStructureInfoKHR &info;
    std::shared_ptr<AccelerationStructure> source, target;
    Judge judge;

    [[nodiscard]] bool compacts() const { return info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR; }

    // Nothing: neither structure tells.
    [[nodiscard]] std::optional<bool> isMicromap() const
    {
        if (target && target->type == kMicromap)
            return true;
        const std::optional<bool> known = source ? knownMicromap(*source) : std::nullopt;
        return !known && target && target->type != kGeneric ? std::optional(false) : known;
    }

    // Of all copies.
    [[nodiscard]] bool valid() const
    {
        // One of a micromap is of nothing else.
        const bool micromap = isMicromap().value_or(false);
        if (micromap && (!source || !target))
            return judge.refuse("VELLUM-copy-type", "one of src and dst is no micromap");
        if (micromap && source->place == target->place)
            return judge.refuse("VELLUM-micromap-copy-overlap", "src and dst overlap");
        if (!source)
            return judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-src-parameter",
                                "src is not an acceleration structure of this device");
        if (!target)
            return judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter",
                                "dst is not an acceleration structure of this device");
        if (source->place == target->place)
            return judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791",
                                "src and dst are the same memory");
        return compacts() || info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR ||
               judge.tolerate("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410",
                              "mode " + std::to_string(info.mode) + " is neither clone nor compact");
    }

    void recordMicromap() const
    {
        if (!canHoldMicromap(*source) || !canHoldMicromap(*target)) {
            judge.refuse("VELLUM-copy-type", "one of src and dst is no micromap");
            return;
        }
        const PlacedMicromap from = lastMicromap(device, *source);
        PlacedMicromap to = from;
        // How many bytes a compact copy has, only the device knows: no more than its source, and than there are.
        if (compacts())
            to.bytes = std::min(from.bytes, roomOf(device.objects, *target));
        if (to.bytes > target->size) {
            judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12418",
                         "dst has " + std::to_string(target->size) + " bytes, src " + std::to_string(to.bytes));
            return;
        }
        to.handle = micromapOfSize(device, *target, to.bytes);
        if (!from.handle || !to.handle) {
            judge.refuse("VELLUM-out-of-memory", "the driver could not make a micromap");
            return;
        }
        VkCopyMicromapInfoEXT copy{VK_STRUCTURE_TYPE_COPY_MICROMAP_INFO_EXT};
        copy.src = from.handle;
        copy.dst = to.handle;
        copy.mode = compacts() ? VK_COPY_MICROMAP_MODE_COMPACT_EXT : VK_COPY_MICROMAP_MODE_CLONE_EXT;
        becomesMicromap(device, *target, std::move(to));
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        device.driver.next.CmdCopyMicromapEXT(commandBuffer, &copy);
        work.barrier();
    }

    void recordStructure() const
    {
        becomesStructure(*target, contentOf(*source), namesMicromaps(*source));
        VkCopyAccelerationStructureInfoKHR driverInfo = info;
        if (!compacts())
            driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
        device.driver.next.CmdCopyAccelerationStructureKHR(commandBuffer, &driverInfo);
    }
};

// What serialized data is to be read as. Commands for micromaps and for others are recorded before the device, or
// anyone, looks at the data; its header is the same.
SerializedPlaces::Data dataAt(const DeviceTranslation &device, const AccelerationStructure &target,
                              VkDeviceAddress source)
{
    auto data = device.serialized.find(device.buffers, source);
    // The sizes of micromaps that are told to applications are marked.
    const bool isMicromap = target.type != kGeneric
                                ? target.type == kMicromap
                                : (data ? data->isMicromap : target.size % 256 == shared::kMicromapSizeMark);
    // Other data may have come there since.
    if (!data || data->isMicromap != isMicromap)
        return {isMicromap};
    return *std::move(data);
}

VkResult refuseOnHost(const DeviceTranslation &device, const char *command)
{
    device.driver.report().notAvailable(std::string(command) + " of a micromap");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace

void cmdCopyTranslatedStructure(DeviceTranslation &device, VkCommandBuffer commandBuffer,
                                const VkCopyAccelerationStructureInfoKHR *info)
{
    const Copy copy{device,
                    commandBuffer,
                    *info,
                    device.objects.accelerationStructures.get(info->src),
                    device.objects.accelerationStructures.get(info->dst),
                    judgeOf(device, "vkCmdCopyAccelerationStructureKHR", info->dst)};
    if (!copy.valid())
        return;
    const std::optional<bool> isMicromap = copy.isMicromap();
    if (!isMicromap)
        device.driver.report().notAvailable("vkCmdCopyAccelerationStructureKHR between two structures of type GENERIC, "
                                            "recorded before any build of the source,");
    else if (*isMicromap)
        copy.recordMicromap();
    else
        copy.recordStructure();
}

void cmdCopyTranslatedStructureToMemory(DeviceTranslation &device, VkCommandBuffer commandBuffer,
                                        const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    const auto source = device.objects.accelerationStructures.get(info->src);
    const Judge judge = judgeOf(device, "vkCmdCopyAccelerationStructureToMemoryKHR", info->src);
    if (!source) {
        judge.refuse("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter",
                     "src is not an acceleration structure of this device");
        return;
    }
    if (info->mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", "mode is not SERIALIZE"))
        return;
    const std::optional<bool> isMicromap = knownMicromap(*source);
    if (!isMicromap) {
        device.driver.report().notAvailable("vkCmdCopyAccelerationStructureToMemoryKHR of a GENERIC structure recorded "
                                            "before any build of it");
        return;
    }
    if (!*isMicromap) {
        if (namesMicromaps(*source)) {
            device.driver.report().notAvailable(
                "vkCmdCopyAccelerationStructureToMemoryKHR of a bottom-level structure with micromaps, on a driver "
                "with VK_EXT_opacity_micromap only,");
            return;
        }
        VkCopyAccelerationStructureToMemoryInfoKHR driverInfo = *info;
        driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        device.serialized.set(device.buffers, info->dst.deviceAddress, {});
        device.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &driverInfo);
        return;
    }
    if (!judge.mayHoldSerialized(info->dst.deviceAddress, 128,
                                 "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739",
                                 "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699"))
        return;
    if (info->dst.deviceAddress % 256 != 0) {
        // VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07542
        device.driver.report().notAvailable("serializing a micromap to an address that is not a multiple of 256, on a "
                                            "driver with VK_EXT_opacity_micromap only,");
        return;
    }
    VkCopyMicromapToMemoryInfoEXT copy{VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT};
    PlacedMicromap micromap = lastMicromap(device, *source);
    copy.src = micromap.handle;
    copy.dst.deviceAddress = info->dst.deviceAddress;
    copy.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    if (!copy.src) {
        judge.refuse("VELLUM-out-of-memory", "the driver could not make a micromap");
        return;
    }
    device.serialized.set(device.buffers, info->dst.deviceAddress,
                          {true, micromap.isKnown, std::move(micromap.usages)});
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    device.driver.next.CmdCopyMicromapToMemoryEXT(commandBuffer, &copy);
    work.barrier();
}

void cmdCopyMemoryToTranslatedStructure(DeviceTranslation &device, VkCommandBuffer commandBuffer,
                                        const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    const auto target = device.objects.accelerationStructures.get(info->dst);
    const Judge judge = judgeOf(device, "vkCmdCopyMemoryToAccelerationStructureKHR", info->dst);
    if (!target) {
        judge.refuse("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter",
                     "dst is not an acceleration structure of this device");
        return;
    }
    if (info->mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", "mode is not DESERIALIZE"))
        return;
    SerializedPlaces::Data data = dataAt(device, *target, info->src.deviceAddress);
    if (!data.isMicromap) {
        becomesStructure(*target, target->type, false);
        VkCopyMemoryToAccelerationStructureInfoKHR driverInfo = *info;
        driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        device.driver.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, &driverInfo);
        return;
    }
    if (!judge.mayHoldSerialized(info->src.deviceAddress, 128,
                                 "VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742",
                                 "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700"))
        return;
    if (info->src.deviceAddress % 256 != 0) {
        // VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07547
        device.driver.report().notAvailable("deserializing a micromap from an address that is not a multiple of 256, "
                                            "on a driver with VK_EXT_opacity_micromap only,");
        return;
    }
    PlacedMicromap micromap;
    micromap.bytes = roomOf(device.objects, *target);
    micromap.isKnown = data.isKnown;
    micromap.usages = std::move(data.usages);
    micromap.handle = micromapOfSize(device, *target, micromap.bytes);
    if (!micromap.handle) {
        judge.refuse("VELLUM-out-of-memory", "the driver could not make a micromap");
        return;
    }
    VkCopyMemoryToMicromapInfoEXT copy{VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT};
    copy.src.deviceAddress = info->src.deviceAddress;
    copy.dst = micromap.handle;
    copy.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    becomesMicromap(device, *target, std::move(micromap));
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    device.driver.next.CmdCopyMemoryToMicromapEXT(commandBuffer, &copy);
    work.barrier();
}

// The host may copy what is no micromap, where the driver lets it.
VkResult copyTranslatedStructure(DeviceTranslation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                 const VkCopyAccelerationStructureInfoKHR *info)
{
    const auto source = device.objects.accelerationStructures.get(info->src);
    const auto target = device.objects.accelerationStructures.get(info->dst);
    if (!source || !isDrivers(target.get()) || knownMicromap(*source).value_or(target->type == kGeneric))
        return refuseOnHost(device, "vkCopyAccelerationStructureKHR");
    becomesStructure(*target, contentOf(*source), namesMicromaps(*source));
    return device.driver.next.CopyAccelerationStructureKHR(handle, operation, info);
}

VkResult copyTranslatedStructureToMemory(DeviceTranslation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                         const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    const auto source = device.objects.accelerationStructures.get(info->src);
    if (!source || knownMicromap(*source).value_or(true) || namesMicromaps(*source))
        return refuseOnHost(device, "vkCopyAccelerationStructureToMemoryKHR");
    return device.driver.next.CopyAccelerationStructureToMemoryKHR(handle, operation, info);
}

VkResult copyMemoryToTranslatedStructure(DeviceTranslation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                         const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    const auto target = device.objects.accelerationStructures.get(info->dst);
    if (!isDrivers(target.get()))
        return refuseOnHost(device, "vkCopyMemoryToAccelerationStructureKHR");
    becomesStructure(*target, target->type, false);
    return device.driver.next.CopyMemoryToAccelerationStructureKHR(handle, operation, info);
}

} // namespace vellum::layer
