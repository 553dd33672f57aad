// SPDX-License-Identifier: Apache-2.0
// The subsystem of VK_KHR_device_address_commands: commands that take address ranges, recorded as older commands.
#pragma once

#include <mutex>

#include "layer/memory/gpu_memory.h"
#include "layer/query_pool/device_query_pools.h"
#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceAddresses;

// VK_KHR_device_address_commands: commands that take address ranges, recorded as older commands that take buffers
// (address_lookup.h). The addressFlags are ignored: older commands get that information from the buffer.
// Replaces a null index buffer on devices without VK_KHR_maintenance6, where none may be bound.
class ZeroIndices
{
public:
    VkBuffer get(const GpuContext &context); // VK_NULL_HANDLE if out of memory

private:
    std::mutex mutex_;
    GpuBuffer buffer_;
};
// Returns whether VK_NULL_HANDLE may be bound as index buffer on a device with this create info.
bool enablesNullIndexBuffer(const VkDeviceCreateInfo &info);

// address_copies.cpp
void cmdCopyMemory(DeviceAddresses &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR *);
void cmdCopyMemoryToImage(DeviceAddresses &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
void cmdCopyImageToMemory(DeviceAddresses &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
void cmdUpdateMemory(DeviceAddresses &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                     VkDeviceSize, const void *);
void cmdFillMemory(DeviceAddresses &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                   uint32_t);
void cmdCopyQueryPoolResultsToMemory(DeviceAddresses &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t,
                                     const VkStridedDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                                     VkQueryResultFlags);
void cmdWriteMarkerToMemory(DeviceAddresses &, VkCommandBuffer, const VkMemoryMarkerInfoAMD *);

// address_draws.cpp
void cmdBindIndexBuffer3(DeviceAddresses &, VkCommandBuffer, const VkBindIndexBuffer3InfoKHR *);
void cmdBindVertexBuffers3(DeviceAddresses &, VkCommandBuffer, uint32_t, uint32_t, const VkBindVertexBuffer3InfoKHR *);
void cmdDrawIndirect2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndexedIndirect2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawMeshTasksIndirect2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndirectCount2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawIndexedIndirectCount2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawMeshTasksIndirectCount2(DeviceAddresses &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDispatchIndirect2(DeviceAddresses &, VkCommandBuffer, const VkDispatchIndirect2InfoKHR *);
void cmdBeginConditionalRendering2(DeviceAddresses &, VkCommandBuffer, const VkConditionalRenderingBeginInfo2EXT *);

// address_draws.cpp: transform feedback
void cmdBindTransformFeedbackBuffers2(DeviceAddresses &, VkCommandBuffer, uint32_t, uint32_t,
                                      const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdBeginTransformFeedback2(DeviceAddresses &, VkCommandBuffer, uint32_t, uint32_t,
                                const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdEndTransformFeedback2(DeviceAddresses &, VkCommandBuffer, uint32_t, uint32_t,
                              const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdDrawIndirectByteCount2(DeviceAddresses &, VkCommandBuffer, uint32_t, uint32_t,
                               const VkBindTransformFeedbackBuffer2InfoEXT *, uint32_t, uint32_t);

struct DeviceAddresses {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
    ZeroIndices zeroIndices{};
};

} // namespace vellum::layer
