// Micromaps: what is done with them, and the front end of VK_EXT_opacity_micromap; that of VK_KHR_opacity_micromap is
// micromap_structure.h.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Device;
struct Micromap;

// What a handle stands for; null for null.
inline Micromap *micromapOf(VkMicromapEXT handle)
{
    return reinterpret_cast<Micromap *>(handle);
}

// Device address of a micromap's memory; 0 for null.
VkDeviceAddress micromapAddress(const Device &device, VkMicromapEXT micromap);
VkDeviceAddress micromapAddress(const Device &device, const Micromap &micromap);
// What the log of wrong input names the micromap by; complaints.h.
uint64_t complaintObject(VkMicromapEXT micromap);

// The work of the commands below, whichever front end has checked it; a null or invalid handle must not come here.
void recordMicromapBuilds(Device &device, VkCommandBuffer commandBuffer,
                          const std::vector<const VkMicromapBuildInfoEXT *> &infos);
// Clone or compact. Refuses, with a message under `command`, what overlaps.
void recordMicromapCopy(Device &device, VkCommandBuffer commandBuffer, const char *command, const Micromap &source,
                        const Micromap &target);
void recordMicromapSave(Device &device, VkCommandBuffer commandBuffer, const Micromap &source, VkDeviceAddress target);
void recordMicromapRestore(Device &device, VkCommandBuffer commandBuffer, const Micromap &target,
                           VkDeviceAddress source);

VKAPI_ATTR VkResult VKAPI_CALL createMicromap(VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                                              VkMicromapEXT *);
VKAPI_ATTR void VKAPI_CALL destroyMicromap(VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);
VKAPI_ATTR void VKAPI_CALL getMicromapBuildSizes(VkDevice, VkAccelerationStructureBuildTypeKHR,
                                                 const VkMicromapBuildInfoEXT *, VkMicromapBuildSizesInfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer, uint32_t, const VkMicromapBuildInfoEXT *);
VKAPI_ATTR void VKAPI_CALL getDeviceMicromapCompatibility(VkDevice, const VkMicromapVersionInfoEXT *,
                                                          VkAccelerationStructureCompatibilityKHR *);
VKAPI_ATTR void VKAPI_CALL cmdCopyMicromap(VkCommandBuffer, const VkCopyMicromapInfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdCopyMicromapToMemory(VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdCopyMemoryToMicromap(VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT *);

// On the host, behind the feature micromapHostCommands.
VKAPI_ATTR VkResult VKAPI_CALL buildMicromaps(VkDevice, VkDeferredOperationKHR, uint32_t,
                                              const VkMicromapBuildInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL copyMicromap(VkDevice, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL copyMicromapToMemory(VkDevice, VkDeferredOperationKHR,
                                                    const VkCopyMicromapToMemoryInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL copyMemoryToMicromap(VkDevice, VkDeferredOperationKHR,
                                                    const VkCopyMemoryToMicromapInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL writeMicromapsProperties(VkDevice, uint32_t, const VkMicromapEXT *, VkQueryType, size_t,
                                                        void *, size_t);

} // namespace vellum::layer
