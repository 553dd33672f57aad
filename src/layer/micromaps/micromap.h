// Micromaps: what is done with them, and the front end of VK_EXT_opacity_micromap; that of VK_KHR_opacity_micromap is
// micromap_structure.h.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/objects/micromap_object.h"

namespace vellum::layer
{

struct DeviceMicromaps;

// What the log of wrong input names the micromap by; complaints.h.
uint64_t complaintObject(VkMicromapEXT micromap);

// The work of the commands below, whichever front end has checked it; a null or invalid handle must not come here.
void recordMicromapBuilds(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                          const std::vector<const VkMicromapBuildInfoEXT *> &infos);
// Clone or compact. Refuses, with a message under `command`, what overlaps.
void recordMicromapCopy(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                        const Micromap &source, const Micromap &target);
void recordMicromapSave(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &source,
                        VkDeviceAddress target);
// Of data that is no micromap's, the target holds none afterwards, with a message; or it stays as it is.
enum class DataThatIsNone { ClearsTheTarget, LeavesTheTarget };
void recordMicromapRestore(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &target,
                           VkDeviceAddress source, DataThatIsNone none = DataThatIsNone::ClearsTheTarget);

VkResult createMicromap(DeviceMicromaps &, VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                        VkMicromapEXT *);
void destroyMicromap(DeviceMicromaps &, VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);
void getMicromapBuildSizes(DeviceMicromaps &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                           const VkMicromapBuildInfoEXT *, VkMicromapBuildSizesInfoEXT *);
void cmdBuildMicromaps(DeviceMicromaps &, VkCommandBuffer, uint32_t, const VkMicromapBuildInfoEXT *);
void getDeviceMicromapCompatibility(DeviceMicromaps &, VkDevice, const VkMicromapVersionInfoEXT *,
                                    VkAccelerationStructureCompatibilityKHR *);
void cmdCopyMicromap(DeviceMicromaps &, VkCommandBuffer, const VkCopyMicromapInfoEXT *);
void cmdCopyMicromapToMemory(DeviceMicromaps &, VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT *);
void cmdCopyMemoryToMicromap(DeviceMicromaps &, VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT *);

// On the host, behind the feature micromapHostCommands.
VkResult buildMicromaps(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR, uint32_t, const VkMicromapBuildInfoEXT *);
VkResult copyMicromap(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *);
VkResult copyMicromapToMemory(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMicromapToMemoryInfoEXT *);
VkResult copyMemoryToMicromap(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMemoryToMicromapInfoEXT *);
VkResult writeMicromapsProperties(DeviceMicromaps &, VkDevice, uint32_t, const VkMicromapEXT *, VkQueryType, size_t,
                                  void *, size_t);

} // namespace vellum::layer
