// Micromaps: what is done with them, and the commands of VK_EXT_opacity_micromap; those of
// VK_KHR_opacity_micromap are in structures/structure_commands.h.
#pragma once

#include <cstdint>
#include <span>

#include <vulkan/vulkan.h>

#include "layer/command_buffer/gpu_validation_log.h"
#include "layer/micromaps/micromap_input.h"

namespace vellum::layer
{

struct DeviceMicromaps;
class InjectedWork;

// The work of the commands below, whichever front end has checked it; a null or invalid handle must not come here.
void recordMicromapBuilds(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                          std::span<const MicromapBuild> builds);
// Clone or compact. Refuses, with a message under `command`, what overlaps.
void recordMicromapCopy(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                        const Micromap &source, const Micromap &target);
void recordMicromapSave(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &source,
                        VkDeviceAddress target);
// Of data that is no micromap's, the target holds none afterwards, with a message; or it stays as it is.
enum class DataThatIsNone { ClearsTheTarget, LeavesTheTarget };
void recordMicromapRestore(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const Micromap &target,
                           VkDeviceAddress source, DataThatIsNone none = DataThatIsNone::ClearsTheTarget);

// What the validation log names a micromap by.
inline uint64_t findingObject(const Micromap &micromap)
{
    return findingObject(micromap.object.type, micromap.object.handle);
}

// Writes a property of a micromap, kQueryMicromap* of core/records.h, to the 64-bit number at `value`.
void recordMicromapProperty(InjectedWork &work, const Driver &driver, const Micromap &micromap, uint32_t kind,
                            VkDeviceAddress value);

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
