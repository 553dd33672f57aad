// SPDX-License-Identifier: Apache-2.0
// The commands of acceleration structures, including micromaps of VK_KHR_opacity_micromap. The layer intercepts them on
// every device whose micromaps it emulates or translates. Each is parsed and checked here, and then recorded by the
// device's back end.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <mutex>
#include <new>
#include <string>

#include "layer/base/commands.h"
#include "layer/base/undo.h"
#include "layer/input/checked.h"
#include "layer/rules/builds.h"
#include "layer/rules/creations.h"
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
    if (!publishesMicromap(device.objects, structure))
        return;
    // Another thread may be querying the buffer's address, and so be in bufferHasAddress().
    std::lock_guard lock(device.objects.unboundMutex);
    auto &unbound = device.objects.unboundMicromaps;
    const auto [first, last] = unbound.equal_range(structure.buffer);
    for (auto at = first; at != last;) {
        const auto other = at->second.lock();
        at = !other || other.get() == &structure ? unbound.erase(at) : std::next(at);
    }
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

// Adds a structure that the driver has created; if this throws, it is destroyed.
void addDriversStructure(DeviceStructures &device, const std::shared_ptr<AccelerationStructure> &structure,
                         VkAccelerationStructureKHR handle, const VkAllocationCallbacks *allocator)
{
    Undo undo([&] { device.driver.next.DestroyAccelerationStructureKHR(device.driver.handle, handle, allocator); });
    addStructure(device, structure, handle);
    undo.keep();
}

VkResult addMicromap(DeviceStructures &device, const BufferRange &range, VkAccelerationStructureKHR &result)
{
    const auto structure = newStructure(range, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    const auto handle = reinterpret_cast<VkAccelerationStructureKHR>(structure.get());
    addStructure(device, structure, handle);
    result = handle;
    return VK_SUCCESS;
}

// --- builds ---

// Records the builds of one command.
template <typename Parse>
void recordBuilds(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command, const BuildInfo *infos,
                  Parse parse)
{
    Backend &backend = *device.backend;
    if (!backend.begin(commandBuffer, command))
        return;
    const auto builds = input::Checked<input::Builds>::take(infos, [&] {
        input::Builds parsed = parse();
        rules::checkBuilds(
            device.objects.rules, Place(command), parsed,
            [&objects = device.objects](ObjectHandle handle) { return structureFacts(objects, handle); });
        return parsed;
    });
    std::vector<MicromapBuild> micromaps;
    for (const input::MicromapBuild &given : builds.micromaps) {
        auto target = device.objects.accelerationStructures.get(infos[given.element].dstAccelerationStructure);
        if (!given.accepted || !target)
            continue;
        MicromapBuild &build = micromaps.emplace_back(micromapBuildOf(given));
        build.target = micromapIn(*target);
        build.structure = std::move(target);
    }
    if (!micromaps.empty())
        backend.record(commandBuffer, command, std::move(micromaps));
    std::vector<StructureBuild> structures;
    for (const input::StructureBuild &given : builds.structures) {
        if (!given.accepted)
            continue;
        StructureBuild build = structureBuildOf(device.driver, given);
        if (!findStructures(device.objects, build))
            continue;
        if (build.hasMicromaps)
            device.objects.warnings.micromapsAreUsed();
        structures.push_back(std::move(build));
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

// Returns whether the driver may execute a host command: only if micromaps are the driver's, and only on other
// structures.
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
        const VkDeviceSize bytes = device.buffers.infos.get(info->buffer).size;
        const auto creation = input::Checked<input::Creation>::take(info, [&] {
            const Place command("vkCreateAccelerationStructureKHR");
            const Place place = command.member("pCreateInfo");
            return rules::checkCreation(InputCheck(device.objects.rules, place, info->buffer), *info, bytes);
        });
        if (!creation.accepted)
            return VK_ERROR_VALIDATION_FAILED_EXT;
        const VkDeviceSize capacity = bytes - std::min(info->offset, bytes);
        return addMicromap(device, {info->buffer, info->offset, std::min(info->size, capacity)}, *result);
    }
    const auto structure = newStructure({info->buffer, info->offset, info->size}, info->type);
    const VkResult created = device.driver.next.CreateAccelerationStructureKHR(handle, info, allocator, result);
    if (created == VK_SUCCESS)
        addDriversStructure(device, structure, *result, allocator);
    return created;
}

namespace
{

// Checks the creation. An empty range if it is rejected.
BufferRange rangeOf(const DeviceState &device, const VkAccelerationStructureCreateInfo2KHR &info)
{
    const auto creation = input::Checked<input::Creation>::take(&info, [&] {
        const Place command("vkCreateAccelerationStructure2KHR");
        const Place place = command.member("pCreateInfo");
        return rules::checkCreation(InputCheck(device.rules, place), info);
    });
    if (!creation.accepted)
        return {};
    const auto &[address, size] = info.addressRange;
    AddressMap::Location found =
        device.buffers.addresses.covering(address, size, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    if (!found.buffer)
        found = device.buffers.addresses.find(address);
    return {found.buffer, found.offset, std::min(size, found.bytes), found.owner};
}

// Creates the driver's structure: by the same command if the driver has it, and otherwise in the buffer.
VkResult createInRange(const Driver &driver, const VkAccelerationStructureCreateInfo2KHR &info,
                       const BufferRange &range, const VkAllocationCallbacks *allocator,
                       VkAccelerationStructureKHR &result)
{
    if (driver.next.CreateAccelerationStructure2KHR)
        return driver.next.CreateAccelerationStructure2KHR(driver.handle, &info, allocator, &result);
    VkAccelerationStructureCreateInfoKHR driverInfo{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    driverInfo.pNext = info.pNext;
    driverInfo.createFlags = info.createFlags;
    driverInfo.buffer = range.buffer;
    driverInfo.offset = range.offset;
    driverInfo.size = range.size;
    // The structure has to have the address of the range. Only those of type GENERIC have that of their memory
    // (vkGetAccelerationStructureDeviceAddressKHR).
    driverInfo.type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    return driver.next.CreateAccelerationStructureKHR(driver.handle, &driverInfo, allocator, &result);
}

} // namespace

VkResult createAccelerationStructure2(DeviceStructures &device, VkDevice,
                                      const VkAccelerationStructureCreateInfo2KHR *info,
                                      const VkAllocationCallbacks *allocator, VkAccelerationStructureKHR *result)
{
    const BufferRange range = rangeOf(device.objects, *info);
    if (!range.buffer)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return addMicromap(device, range, *result);
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
    sizes->accelerationStructureSize = sizes->updateScratchSize = sizes->buildScratchSize = 0;
    const auto query = input::Checked<input::Builds>::take(info, [&] {
        input::Builds parsed = input::parse(1, info, nullptr);
        rules::checkSizes(device.objects.rules, Place("vkGetAccelerationStructureBuildSizesKHR"), parsed);
        return parsed;
    });
    if (!query.micromaps.empty()) {
        const input::BuildNeeds &needs = query.micromaps[0].needs; // none unless the query is accepted
        sizes->accelerationStructureSize = needs.micromap;
        sizes->buildScratchSize = needs.scratch;
    } else if (query.structures[0].accepted) {
        StructureBuild build = structureBuildOf(device.driver, query.structures[0]);
        // They are ignored, and may be handles of micromaps.
        build.info.srcAccelerationStructure = build.info.dstAccelerationStructure = VK_NULL_HANDLE;
        // Without pMaxPrimitiveCounts all counts are 0:
        // VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11612
        const std::vector<uint32_t> none(maxPrimitives ? 0 : info->geometryCount);
        device.backend->getSizes(type, build, maxPrimitives ? maxPrimitives : none.data(), *sizes);
    }
}

void cmdBuildAccelerationStructures(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const BuildInfo *infos, const RangeInfo *const *ranges)
{
    recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", infos,
                 [&] { return input::parse(count, infos, ranges); });
}

void cmdBuildAccelerationStructuresIndirect(DeviceStructures &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const BuildInfo *infos, const VkDeviceAddress *addresses,
                                            const uint32_t *strides, const uint32_t *const *most)
{
    recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresIndirectKHR", infos,
                 [&] { return input::parseIndirect(count, infos, addresses, strides, most); });
}

void cmdCopyAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyAccelerationStructureKHR";
    if (!device.backend->begin(commandBuffer, kCommand))
        return;
    const auto copy = structureCopyOf(device.objects, kCommand, *info);
    if (!copy)
        return;
    if (const VkDeviceSize bytes = device.backend->cloneBytes(*copy); !copy->compact && copy->target->size < bytes)
        rejectCommand(device.driver, kCommand, info->dst, "VUID-VkCopyAccelerationStructureInfoKHR-mode-12418",
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
    if (const auto copy = saveOf(device.objects, kCommand, *info))
        device.backend->recordSave(commandBuffer, *copy);
}

void cmdCopyMemoryToAccelerationStructure(DeviceStructures &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    constexpr const char *kCommand = "vkCmdCopyMemoryToAccelerationStructureKHR";
    if (!device.backend->begin(commandBuffer, kCommand))
        return;
    if (const auto copy = restoreOf(device.objects, kCommand, *info))
        device.backend->recordRestore(commandBuffer, *copy);
}

// Host commands. The driver alone would lose the records of emulated micromaps, and the host cannot build or copy
// micromaps of VK_KHR_opacity_micromap: these commands report that they are not available.
VkResult buildAccelerationStructures(DeviceStructures &device, VkDevice handle, VkDeferredOperationKHR operation,
                                     uint32_t count, const BuildInfo *infos, const RangeInfo *const *ranges)
{
    constexpr const char *kCommand = "vkBuildAccelerationStructuresKHR";
    if (device.driver.emulated())
        return rejectOnHost(device, kCommand);
    const auto builds = input::Checked<input::Builds>::take(infos, [&] {
        input::Builds parsed = input::parse(count, infos, ranges);
        rules::checkHostBuilds(device.objects.rules, Place(kCommand), parsed);
        return parsed;
    });
    if (!builds.micromaps.empty())
        return rejectOnHost(device, std::string(kCommand) + " with micromaps");
    // A deferred build reads its input later, so the driver gets the application's structures.
    for (const input::StructureBuild &build : builds.structures) {
        const BuildInfo &info = *build.given;
        if (!build.accepted)
            return VK_ERROR_VALIDATION_FAILED_EXT;
        const bool micromaps = std::ranges::any_of(build.geometries, [](const input::Geometry &geometry) {
            return geometry.attachment && geometry.attachment->khr;
        });
        if (micromaps || !isDrivers(device, info.dstAccelerationStructure) ||
            (build.isUpdate() && !isDrivers(device, info.srcAccelerationStructure)))
            return rejectOnHost(device, std::string(kCommand) + " with micromaps");
    }
    for (const input::StructureBuild &build : builds.structures)
        becomesStructure(*device.objects.accelerationStructures.get(build.given->dstAccelerationStructure),
                         build.isTopLevel() ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                                            : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
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
