// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_commands.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <new>
#include <string>

#include "layer/base/undo.h"
#include "layer/state/buffer_range.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/exact_size_handle.h"

namespace vellum::layer
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

// --- objects ---

void forgetStructure(DeviceStructures &device, AccelerationStructure &structure)
{
    leaveLocation(device.objects, structure);
    destroyExactSizeHandles(device, structure);
    // Another thread may be querying the buffer's address, and so be in bufferHasAddress().
    std::lock_guard lock(device.objects.unboundMutex);
    std::erase_if(device.objects.unboundMicromaps, [&](const std::weak_ptr<AccelerationStructure> &unbound) {
        const auto other = unbound.lock();
        return !other || other.get() == &structure;
    });
    if (structure.micromapKey)
        device.objects.root.releaseDescriptor(structure.micromapKey);
}

// Registers a new structure under its handle. If this throws, nothing is registered.
void addStructure(DeviceStructures &device, const std::shared_ptr<AccelerationStructure> &structure,
                  VkAccelerationStructureKHR handle)
{
    structure->handle = handle;
    enterLocation(device.objects, *structure);
    Undo undo([&] { forgetStructure(device, *structure); });
    device.backend->created(structure);
    if (isLayerObject(*structure) && !device.backend->createMicromap(*structure))
        throw std::bad_alloc(); // the only error of vkCreateMicromapEXT
    device.objects.accelerationStructures.set(handle, structure);
    undo.keep();
}

// The same for a structure that the driver has created; if this throws, it is destroyed.
void addDriversStructure(DeviceStructures &device, const std::shared_ptr<AccelerationStructure> &structure,
                         VkAccelerationStructureKHR handle, const VkAllocationCallbacks *allocator)
{
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(device.driver.handle, handle, allocator); });
    addStructure(device, structure, handle);
    undo.keep();
}

VkResult addMicromap(DeviceStructures &device, const InputCheck &check, const BufferRange &range,
                     VkAccelerationStructureKHR &result)
{
    if (!device.backend->checkMicromap(check, range))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const auto structure = newStructure(range, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    const auto handle = reinterpret_cast<VkAccelerationStructureKHR>(structure.get());
    addStructure(device, structure, handle);
    result = handle;
    return VK_SUCCESS;
}

// --- builds ---

// Records the builds of one command. `ranges(i)`: the ranges of element i.
template <typename Ranges>
void recordBuilds(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command, uint32_t count,
                  const BuildInfo *infos, bool indirect, Ranges ranges)
{
    Backend &backend = *device.backend;
    if (!backend.begin(commandBuffer, command))
        return;
    std::vector<MicromapBuild> micromaps;
    MicromapSet built;
    for (uint32_t i = 0; i < count; ++i) {
        if (!isMicromapBuild(infos[i]))
            continue;
        built.insert(infos[i].dstAccelerationStructure);
        const InputCheck check = inputCheck(device.driver, command, infos[i].dstAccelerationStructure, i);
        // Tolerated: a micromap has no ranges.
        if (indirect && !check.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557",
                                        "a micromap is not built indirectly"))
            continue;
        auto build = parseMicromapBuild(device.driver, check, infos[i], backend.limits());
        if (build && checkMicromapBuild(device.objects, check, infos[i], backend.sizes(*build), *build))
            micromaps.push_back(*std::move(build));
    }
    if (!micromaps.empty())
        backend.record(commandBuffer, command, std::move(micromaps));
    std::vector<StructureBuild> structures;
    for (uint32_t i = 0; i < count; ++i) {
        if (isMicromapBuild(infos[i]))
            continue;
        const InputCheck check = inputCheck(device.driver, command, infos[i].dstAccelerationStructure, i);
        auto build = parseStructureBuild(device.driver, check, infos[i]);
        if (!build)
            continue;
        build->element = i;
        build->ranges = ranges(i);
        if (!checkStructureBuild(device.objects, check, built, *build))
            continue;
        if (build->hasMicromaps)
            device.objects.warnings.micromapsAreUsed();
        structures.push_back(*std::move(build));
    }
    if (!structures.empty())
        backend.record(commandBuffer, command, std::move(structures));
}

// --- host commands ---

VkResult rejectOnHost(const DeviceStructures &device, const std::string &what)
{
    device.driver.report().notAvailable(what);
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

// Whether the driver may execute a host command: only if micromaps are the driver's, and only on other structures.
bool isDrivers(const DeviceStructures &device, VkAccelerationStructureKHR handle)
{
    const auto structure = device.objects.accelerationStructures.get(handle);
    return device.driver.translated() && structure && !isLayerObject(*structure);
}

} // namespace

VkResult createAccelerationStructure(DeviceStructures &device, VkDevice handle,
                                     const VkAccelerationStructureCreateInfoKHR *info,
                                     const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
        const InputCheck check(device.driver.report(), "vkCreateAccelerationStructureKHR");
        const VkDeviceSize bytes = device.buffers.infos.get(info->buffer).size;
        const bool possible = info->offset % 16 == 0 && info->offset < bytes;
        if (!check.tolerateIf(possible, "VELLUM-VUID-VkAccelerationStructureCreateInfoKHR-type-11600",
                              "a micromap is made by vkCreateAccelerationStructure2KHR"))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        return addMicromap(device, check, {info->buffer, info->offset, std::min(info->size, bytes - info->offset)},
                           *result);
    }
    const auto structure = newStructure({info->buffer, info->offset, info->size}, info->type);
    const VkResult created = device.driver.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created == VK_SUCCESS)
        addDriversStructure(device, structure, *result, allocator);
    return created;
}

VkResult createAccelerationStructure2(DeviceStructures &device, VkDevice,
                                      const VkAccelerationStructureCreateInfo2KHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    const BufferRange range = rangeOf(device.objects, *info, device.backend->micromapAlignment());
    if (!range.buffer)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return addMicromap(device, {device.driver.report(), "vkCreateAccelerationStructure2KHR"}, range, *result);
    const auto structure = newStructure(range, info->type);
    const VkResult created = createInRange(device.driver, *info, range, allocator, *result);
    if (created == VK_SUCCESS)
        addDriversStructure(device, structure, *result, allocator);
    return created;
}

void destroyAccelerationStructure(DeviceStructures &device, VkDevice handle, VkAccelerationStructureKHR structure,
                                  const VkAllocationCallbacks *allocator)
{
    const auto known = device.objects.accelerationStructures.take(structure);
    if (known)
        forgetStructure(device, *known);
    device.driver.report().setName(reinterpret_cast<uint64_t>(structure), "");
    if (known && isLayerObject(*known)) {
        device.objects.privateData.forgetObject(reinterpret_cast<uint64_t>(structure));
        return;
    }
    device.driver.next.DestroyAccelerationStructureKHR(handle, structure, allocator);
}

VkDeviceAddress getAccelerationStructureDeviceAddress(DeviceStructures &device, VkDevice handle,
                                                      const VkAccelerationStructureDeviceAddressInfoKHR *info)
{
    const auto structure = device.objects.accelerationStructures.get(info->accelerationStructure);
    if (structure && isLayerObject(*structure)) {
        // VUID-VkBufferDeviceAddressInfo-buffer-02601
        const bool hasAddress =
            (device.buffers.infos.get(structure->buffer).usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
        return hasAddress ? beginOf(device.driver, *structure) : 0;
    }
    if (structure)
        device.backend->addressTaken(*structure);
    return device.driver.next.GetAccelerationStructureDeviceAddressKHR(handle, info);
}

VkResult getAccelerationStructureCaptureData(DeviceStructures &device, VkDevice handle,
                                             const VkAccelerationStructureCaptureDescriptorDataInfoEXT *info,
                                             void *data)
{
    const auto structure = device.objects.accelerationStructures.get(info->accelerationStructure);
    if (!structure || !isLayerObject(*structure))
        return device.driver.next.GetAccelerationStructureOpaqueCaptureDescriptorDataEXT(handle, info, data);
    // The driver has no object of it that it could replay.
    VkPhysicalDeviceDescriptorBufferPropertiesEXT sizes{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_BUFFER_PROPERTIES_EXT};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &sizes, {}};
    device.driver.instance->GetPhysicalDeviceProperties2(device.driver.physicalDevice, &properties);
    std::memset(data, 0, sizes.accelerationStructureCaptureReplayDescriptorDataSize);
    return VK_SUCCESS;
}

void getDeviceAccelerationStructureCompatibility(DeviceStructures &device, VkDevice,
                                                 const VkAccelerationStructureVersionInfoKHR *info,
                                                 VkAccelerationStructureCompatibilityKHR *compatibility)
{
    *compatibility = device.backend->compatibility(*info);
}

void getAccelerationStructureBuildSizes(DeviceStructures &device, VkDevice, VkAccelerationStructureBuildTypeKHR type,
                                        const BuildInfo *info, const uint32_t *maxPrimitives,
                                        VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    const InputCheck check(device.driver.report(), "vkGetAccelerationStructureBuildSizesKHR");
    sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
    if (isMicromapBuild(*info)) {
        const auto build = parseMicromapBuild(device.driver, check, *info, device.backend->limits());
        if (!build)
            return;
        const MicromapBuildSizes needed = device.backend->sizes(*build);
        sizes->accelerationStructureSize = markedMicromapSize(needed.micromap);
        sizes->buildScratchSize = needed.scratch;
    } else if (auto build = parseStructureBuild(device.driver, check, *info)) {
        // They are ignored, and may be handles of micromaps.
        build->info.srcAccelerationStructure = build->info.dstAccelerationStructure = VK_NULL_HANDLE;
        // Without numbers of primitives there are none:
        // VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11612
        const std::vector<uint32_t> none(maxPrimitives ? 0 : info->geometryCount);
        device.backend->getSizes(type, *build, maxPrimitives ? maxPrimitives : none.data(), *sizes);
    }
}

void cmdBuildAccelerationStructures(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const BuildInfo *infos, const RangeInfo *const *ranges)
{
    recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", count, infos, false,
                 [&](uint32_t i) { return BuildRanges{.direct = ranges ? ranges[i] : nullptr}; });
}

void cmdBuildAccelerationStructuresIndirect(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const BuildInfo *infos, const VkDeviceAddress *addresses,
                                            const uint32_t *strides, const uint32_t *const *most)
{
    recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresIndirectKHR", count, infos, true,
                 [&](uint32_t i) {
                     return BuildRanges{nullptr, addresses ? addresses[i] : 0, strides ? strides[i] : 0,
                                        most ? most[i] : nullptr};
                 });
}

void cmdCopyAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureKHR";
    if (!device.backend->begin(commandBuffer, kCommand))
        return;
    const auto copy = parseStructureCopy(device.objects, kCommand, *info);
    if (!copy)
        return;
    if (const VkDeviceSize bytes = device.backend->cloneBytes(*copy); !copy->compact && copy->target->size < bytes)
        inputCheck(device.driver, kCommand, info->dst)
            .reject("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12418",
                    "dst has " + std::to_string(copy->target->size) + " bytes, src " + std::to_string(bytes));
    else
        device.backend->record(commandBuffer, *copy);
}

void cmdCopyAccelerationStructureToMemory(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureToMemoryKHR";
    if (!device.backend->begin(commandBuffer, kCommand))
        return;
    if (const auto copy = parseSave(device.objects, kCommand, *info))
        device.backend->recordSave(commandBuffer, *copy);
}

void cmdCopyMemoryToAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";
    if (!device.backend->begin(commandBuffer, kCommand))
        return;
    if (const auto copy = parseRestore(device.objects, kCommand, *info))
        device.backend->recordRestore(commandBuffer, *copy);
}

VkResult buildAccelerationStructures(DeviceStructures &device, VkDevice handle, VkDeferredOperationKHR operation,
                                     uint32_t count, const BuildInfo *infos, const RangeInfo *const *ranges)
{
    constexpr const char *kCommand = "vkBuildAccelerationStructuresKHR";
    if (device.driver.emulated())
        return rejectOnHost(device, kCommand);
    // A deferred build reads its input later, so the driver gets the application's structures.
    std::vector<VkAccelerationStructureTypeKHR> types;
    for (uint32_t i = 0; i < count; ++i) {
        if (isMicromapBuild(infos[i]))
            return rejectOnHost(device, std::string(kCommand) + " with micromaps");
        const auto build = parseStructureBuild(
            device.driver, inputCheck(device.driver, kCommand, infos[i].dstAccelerationStructure, i), infos[i]);
        if (!build)
            return VK_ERROR_VALIDATION_FAILED_EXT;
        const bool update = infos[i].mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        if (build->hasMicromaps || !isDrivers(device, infos[i].dstAccelerationStructure) ||
            (update && !isDrivers(device, infos[i].srcAccelerationStructure)))
            return rejectOnHost(device, std::string(kCommand) + " with micromaps");
        types.push_back(build->type());
    }
    for (uint32_t i = 0; i < count; ++i)
        becomesStructure(*device.objects.accelerationStructures.get(infos[i].dstAccelerationStructure), types[i],
                         false);
    return device.driver.next.BuildAccelerationStructuresKHR(handle, operation, count, infos, ranges);
}

VkResult copyAccelerationStructure(DeviceStructures &device, VkDevice handle, VkDeferredOperationKHR operation,
                                   const VkCopyAccelerationStructureInfoKHR *info)
{
    const auto source = device.objects.accelerationStructures.get(info->src);
    const auto target = device.objects.accelerationStructures.get(info->dst);
    if (!isDrivers(device, info->src) || !isDrivers(device, info->dst) ||
        holdsMicromap(device.driver, *source).value_or(target->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR))
        return rejectOnHost(device, "vkCopyAccelerationStructureKHR of a micromap");
    becomesStructure(*target, contentOf(device.driver, *source), namesMicromaps(*source));
    return device.driver.next.CopyAccelerationStructureKHR(handle, operation, info);
}

VkResult copyAccelerationStructureToMemory(DeviceStructures &device, VkDevice handle, VkDeferredOperationKHR operation,
                                           const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    const auto source = device.objects.accelerationStructures.get(info->src);
    if (!isDrivers(device, info->src) || holdsMicromap(device.driver, *source).value_or(true) ||
        namesMicromaps(*source))
        return rejectOnHost(device, "vkCopyAccelerationStructureToMemoryKHR of a micromap");
    return device.driver.next.CopyAccelerationStructureToMemoryKHR(handle, operation, info);
}

VkResult copyMemoryToAccelerationStructure(DeviceStructures &device, VkDevice handle, VkDeferredOperationKHR operation,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    if (!isDrivers(device, info->dst))
        return rejectOnHost(device, "vkCopyMemoryToAccelerationStructureKHR of a micromap");
    const auto target = device.objects.accelerationStructures.get(info->dst);
    becomesStructure(*target, target->type, false);
    return device.driver.next.CopyMemoryToAccelerationStructureKHR(handle, operation, info);
}

} // namespace vellum::layer
