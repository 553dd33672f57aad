// Serialization of acceleration structures (core/records.h). The driver writes to memory of the layer's; what goes to
// the application's goes through shaders, which know where that ends.
#include <algorithm>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/micromaps/micromap.h"
#include "layer/micromaps/micromap_serialized.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/serialized_data.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

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
    push.leastUnits = unitsOf(TopLevelLayout(device.driver, 0, 0).tailOffset);
    push.capacity = unitsOf(device.buffers.addresses.bytesFrom(target));
    for (push.pass = 0; push.pass < 2; ++push.pass) {
        work.dispatch(InjectedShader::TopSave, push, push.pass == 0 ? 1 : copyInvocations(source.size), 64);
        work.barrier();
    }
}

void saveBottomLevel(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer, CommandState &state,
                     AccelerationStructure &source, VkDeviceAddress descriptor, VkDeviceAddress target)
{
    const VkAccelerationStructureKHR exactSizeHandles = exactSizeHandle(device, source);
    const VkDeviceSize stagingBytes =
        (exactSizeHandles == source.handle ? source.size : lastBytes(source)) + kDriverOverhead;
    state.scratch.restart();
    const VkDeviceAddress staging = state.scratch.allocate(kPlanBytes + stagingBytes);
    if (!staging) {
        inputCheck(device.driver, "vkCmdCopyAccelerationStructureToMemoryKHR", source.handle)
            .reject("VELLUM-out-of-memory", "no memory for the driver's serialized data");
        return;
    }
    VkCopyAccelerationStructureToMemoryInfoKHR driverInfo{
        VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
    driverInfo.src = exactSizeHandles;
    driverInfo.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    driverInfo.dst.deviceAddress = staging + kPlanBytes;
    device.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, &driverInfo);
    work.barrier();
    const FallbackFacts fallback = fallbackStructure(device);
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
        work.barrier();
    }
}

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
    if (std::memcmp(info.pVersionData, &micromap, 2 * VK_UUID_SIZE) == 0)
        return VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
    // Whether the driver can read it is the driver's to say. Data of the driver alone is not compatible.
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

} // namespace vellum::layer
