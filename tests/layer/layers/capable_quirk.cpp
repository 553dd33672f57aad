// SPDX-License-Identifier: Apache-2.0
// The quirk "capable": features that lavapipe lacks, made out of lavapipe, whose device addresses are the host's.
//   - accelerationStructureIndirectBuild: the ranges are read when the build is recorded, and built directly.
//   - accelerationStructureHostCommands: is only said, since nothing may come of it.
//   - bufferDeviceAddressCaptureReplay and accelerationStructureCaptureReplay: buffers, memory and structures take the
//     flags, and are where they happen to be; with the quirk "replay", where they were requested. A structure that was
//     requested elsewhere is not created.
#include "layers/driver.h"

#include <cstring>
#include <map>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::IndirectBuilds;

// The features of this level, in whatever structures a chain has them.
void setFeatures(const void *chain, VkBool32 value)
{
    if (auto *f = inChainOut<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR))
        f->accelerationStructureIndirectBuild = f->accelerationStructureHostCommands =
            f->accelerationStructureCaptureReplay = value;
    if (auto *f = inChainOut<VkPhysicalDeviceBufferDeviceAddressFeatures>(
            chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES))
        f->bufferDeviceAddressCaptureReplay = value;
    if (auto *f =
            inChainOut<VkPhysicalDeviceVulkan12Features>(chain, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES))
        f->bufferDeviceAddressCaptureReplay = value;
}

VKAPI_ATTR void VKAPI_CALL getFeatures2(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    setFeatures(features->pNext, VK_TRUE);
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    setFeatures(info->pNext, VK_FALSE); // lavapipe has no such features
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, info, allocator, device);
    setFeatures(info->pNext, VK_TRUE);
    return result;
}

// Lavapipe does not know the flags.
VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    VkBufferCreateInfo plain = *info;
    plain.flags &= ~static_cast<VkBufferCreateFlags>(VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT);
    return DRIVER_NEXT(vkCreateBuffer)(handle, &plain, allocator, buffer);
}

// The creation flag for replay needs no check here: Khronos' validation layer checks the buffers.
VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *allocator,
                                               VkAccelerationStructureKHR *structure)
{
    VkAccelerationStructureCreateInfoKHR plain = *info;
    plain.createFlags &= ~static_cast<VkFlags>(VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR);
    plain.deviceAddress = 0;
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructureKHR)(handle, &plain, allocator, structure);
    if (result != VK_SUCCESS || info->deviceAddress == 0)
        return result;
    const auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = *structure});
    if (DRIVER_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, &query) == info->deviceAddress)
        return result;
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, *structure, allocator);
    *structure = VK_NULL_HANDLE;
    return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    std::vector<std::vector<VkAccelerationStructureBuildRangeInfoKHR>> ranges(count);
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> pointers;
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t g = 0; g < infos[i].geometryCount; ++g) {
            VkAccelerationStructureBuildRangeInfoKHR range;
            std::memcpy(&range, reinterpret_cast<const void *>(addresses[i] + uint64_t{g} * strides[i]), sizeof range);
            range.primitiveCount = std::min(range.primitiveCount, most[i][g]);
            ranges[i].push_back(range);
        }
        pointers.push_back(ranges[i].data());
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, pointers.data());
}

} // namespace

driver::LevelRows driver::indirectBuildRows()
{
    static const Row device[]{
        {"vkCreateBuffer", DRIVER_FUNCTION(createBuffer)},
        {"vkCreateAccelerationStructureKHR", DRIVER_FUNCTION(createStructure)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(cmdBuildIndirect), Row::Where::Always},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures2)},
    };
    return {device, instance};
}

// --- of every mock driver: commands of features that are not enabled, which wrong programs record. Lavapipe 25 does
// nothing then, lavapipe 26 ends the process. ---

namespace
{

std::mutex mutex;
std::map<void *, bool> buildsIndirectly; // by the dispatch key of the device

VKAPI_ATTR VkResult VKAPI_CALL rememberFeatures(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                                const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const auto *features = inChain<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
    const bool indirectly = features != nullptr && features->accelerationStructureIndirectBuild != VK_FALSE;
    const VkResult result =
        next<PFN_vkCreateDevice>(Level::Unsupported, keyOf(handle), "vkCreateDevice")(handle, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        buildsIndirectly[keyOf(*device)] = indirectly;
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL buildIndirectIfEnabled(VkCommandBuffer handle, uint32_t count,
                                                  const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                                  const VkDeviceAddress *addresses, const uint32_t *strides,
                                                  const uint32_t *const *most)
{
    {
        std::lock_guard lock(mutex);
        if (!buildsIndirectly[keyOf(handle)])
            return;
    }
    next<PFN_vkCmdBuildAccelerationStructuresIndirectKHR>(
        Level::Unsupported, keyOf(handle), "vkCmdBuildAccelerationStructuresIndirectKHR")(handle, count, infos,
                                                                                          addresses, strides, most);
}

} // namespace

driver::LevelRows driver::unsupportedRows()
{
    static const Row device[]{
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(buildIndirectIfEnabled)},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(rememberFeatures)},
    };
    return {device, instance};
}
