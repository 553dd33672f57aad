// VK_KHR_device_address_commands: commands that take address ranges where older ones take buffers, carried out with the
// older ones (layer/address_lookup.h). What the addressFlags tell, every driver finds out from the buffer.
#pragma once

#include <mutex>

#include "layer/memory/gpu_memory.h"
#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

// Stands for a null index buffer where the driver cannot be given one (VK_KHR_maintenance6 is not enabled).
class ZeroIndices
{
public:
    VkBuffer get(const GpuContext &context); // VK_NULL_HANDLE where there is no memory for it

private:
    std::mutex mutex_;
    GpuBuffer buffer_;
};
// Whether VK_NULL_HANDLE may be bound as index buffer on a device made like this.
bool enablesNullIndexBuffer(const VkDeviceCreateInfo &info);

// address_copies.cpp
VKAPI_ATTR void VKAPI_CALL cmdCopyMemory(VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdCopyMemoryToImage(VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdCopyImageToMemory(VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdUpdateMemory(VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                                           VkDeviceSize, const void *);
VKAPI_ATTR void VKAPI_CALL cmdFillMemory(VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                                         uint32_t);
VKAPI_ATTR void VKAPI_CALL cmdCopyQueryPoolResultsToMemory(VkCommandBuffer, VkQueryPool, uint32_t, uint32_t,
                                                           const VkStridedDeviceAddressRangeKHR *,
                                                           VkAddressCommandFlagsKHR, VkQueryResultFlags);
VKAPI_ATTR void VKAPI_CALL cmdWriteMarkerToMemory(VkCommandBuffer, const VkMemoryMarkerInfoAMD *);

// address_draws.cpp
VKAPI_ATTR void VKAPI_CALL cmdBindIndexBuffer3(VkCommandBuffer, const VkBindIndexBuffer3InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdBindVertexBuffers3(VkCommandBuffer, uint32_t, uint32_t,
                                                 const VkBindVertexBuffer3InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawIndirect2(VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawIndexedIndirect2(VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawMeshTasksIndirect2(VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawIndirectCount2(VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawIndexedIndirectCount2(VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDrawMeshTasksIndirectCount2(VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdDispatchIndirect2(VkCommandBuffer, const VkDispatchIndirect2InfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdBeginConditionalRendering2(VkCommandBuffer, const VkConditionalRenderingBeginInfo2EXT *);

// address_transform_feedback.cpp
VKAPI_ATTR void VKAPI_CALL cmdBindTransformFeedbackBuffers2(VkCommandBuffer, uint32_t, uint32_t,
                                                            const VkBindTransformFeedbackBuffer2InfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdBeginTransformFeedback2(VkCommandBuffer, uint32_t, uint32_t,
                                                      const VkBindTransformFeedbackBuffer2InfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdEndTransformFeedback2(VkCommandBuffer, uint32_t, uint32_t,
                                                    const VkBindTransformFeedbackBuffer2InfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdDrawIndirectByteCount2(VkCommandBuffer, uint32_t, uint32_t,
                                                     const VkBindTransformFeedbackBuffer2InfoEXT *, uint32_t, uint32_t);

} // namespace vellum::layer
