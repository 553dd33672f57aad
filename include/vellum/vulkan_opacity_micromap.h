// SPDX-License-Identifier: Apache-2.0
// VK_KHR_opacity_micromap and VK_KHR_device_address_commands for programs with older Vulkan headers: all types, values
// and prototypes that the installed headers lack. Include it instead of vulkan/vulkan.h, in C or C++; the installed
// headers must be of Vulkan 1.3.239 or newer. Source: xml/vk.xml of KhronosGroup/Vulkan-Docs, version 1.4.363.
//
// Loaders do not export the commands; get them from vkGetDeviceProcAddr.
#ifndef VELLUM_VULKAN_OPACITY_MICROMAP_H_
#define VELLUM_VULKAN_OPACITY_MICROMAP_H_

#include <vulkan/vulkan.h>

#ifndef VK_EXT_opacity_micromap
#error "vellum/vulkan_opacity_micromap.h needs the Vulkan headers 1.3.239 or newer"
#endif

#ifdef __cplusplus
extern "C" {
#endif

// A value of an enumeration in the installed headers that lacks it there.
#ifdef __cplusplus
#define VELLUM_VULKAN_VALUE(type, value) static_cast<type>(value)
#else
#define VELLUM_VULKAN_VALUE(type, value) ((type)(value))
#endif

#ifndef VK_KHR_device_address_commands
#define VK_KHR_device_address_commands 1
#define VK_KHR_DEVICE_ADDRESS_COMMANDS_SPEC_VERSION 1
#define VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME "VK_KHR_device_address_commands"

#define VK_STRUCTURE_TYPE_DEVICE_MEMORY_COPY_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318000)
#define VK_STRUCTURE_TYPE_COPY_DEVICE_MEMORY_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318001)
#define VK_STRUCTURE_TYPE_DEVICE_MEMORY_IMAGE_COPY_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318002)
#define VK_STRUCTURE_TYPE_COPY_DEVICE_MEMORY_IMAGE_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318003)
#define VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318004)
#define VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIER_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318005)
#define VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR                                         \
    VELLUM_VULKAN_VALUE(VkStructureType, 1000318006)
#define VK_STRUCTURE_TYPE_BIND_INDEX_BUFFER_3_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318007)
#define VK_STRUCTURE_TYPE_BIND_VERTEX_BUFFER_3_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318008)
#define VK_STRUCTURE_TYPE_DRAW_INDIRECT_2_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318009)
#define VK_STRUCTURE_TYPE_DRAW_INDIRECT_COUNT_2_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318010)
#define VK_STRUCTURE_TYPE_DISPATCH_INDIRECT_2_INFO_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318011)
#define VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_2_EXT VELLUM_VULKAN_VALUE(VkStructureType, 1000318012)
#define VK_STRUCTURE_TYPE_BIND_TRANSFORM_FEEDBACK_BUFFER_2_INFO_EXT VELLUM_VULKAN_VALUE(VkStructureType, 1000318013)
#define VK_STRUCTURE_TYPE_MEMORY_MARKER_INFO_AMD VELLUM_VULKAN_VALUE(VkStructureType, 1000318014)
#define VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000318015)

typedef enum VkAddressCommandFlagBitsKHR {
    VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR = 0x00000001,
    VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR = 0x00000002,
    VK_ADDRESS_COMMAND_STORAGE_BUFFER_USAGE_BIT_KHR = 0x00000004,
    VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR = 0x00000008,
    VK_ADDRESS_COMMAND_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR = 0x00000010,
    VK_ADDRESS_COMMAND_UNKNOWN_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR = 0x00000020,
    VK_ADDRESS_COMMAND_FLAG_BITS_MAX_ENUM_KHR = 0x7FFFFFFF
} VkAddressCommandFlagBitsKHR;
typedef VkFlags VkAddressCommandFlagsKHR;

typedef struct VkDeviceAddressRangeKHR {
    VkDeviceAddress address;
    VkDeviceSize size;
} VkDeviceAddressRangeKHR;

typedef struct VkStridedDeviceAddressRangeKHR {
    VkDeviceAddress address;
    VkDeviceSize size;
    VkDeviceSize stride;
} VkStridedDeviceAddressRangeKHR;

typedef struct VkDeviceMemoryCopyKHR {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR srcRange;
    VkAddressCommandFlagsKHR srcFlags;
    VkDeviceAddressRangeKHR dstRange;
    VkAddressCommandFlagsKHR dstFlags;
} VkDeviceMemoryCopyKHR;

typedef struct VkCopyDeviceMemoryInfoKHR {
    VkStructureType sType;
    const void *pNext;
    uint32_t regionCount;
    const VkDeviceMemoryCopyKHR *pRegions;
} VkCopyDeviceMemoryInfoKHR;

typedef struct VkDeviceMemoryImageCopyKHR {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    uint32_t addressRowLength;
    uint32_t addressImageHeight;
    VkImageSubresourceLayers imageSubresource;
    VkImageLayout imageLayout;
    VkOffset3D imageOffset;
    VkExtent3D imageExtent;
} VkDeviceMemoryImageCopyKHR;

typedef struct VkCopyDeviceMemoryImageInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkImage image;
    uint32_t regionCount;
    const VkDeviceMemoryImageCopyKHR *pRegions;
} VkCopyDeviceMemoryImageInfoKHR;

typedef struct VkMemoryRangeBarrierKHR {
    VkStructureType sType;
    const void *pNext;
    VkPipelineStageFlags2 srcStageMask;
    VkAccessFlags2 srcAccessMask;
    VkPipelineStageFlags2 dstStageMask;
    VkAccessFlags2 dstAccessMask;
    uint32_t srcQueueFamilyIndex;
    uint32_t dstQueueFamilyIndex;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
} VkMemoryRangeBarrierKHR;

typedef struct VkMemoryRangeBarriersInfoKHR {
    VkStructureType sType;
    const void *pNext;
    uint32_t memoryRangeBarrierCount;
    const VkMemoryRangeBarrierKHR *pMemoryRangeBarriers;
} VkMemoryRangeBarriersInfoKHR;

typedef struct VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR {
    VkStructureType sType;
    void *pNext;
    VkBool32 deviceAddressCommands;
} VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR;

typedef struct VkBindIndexBuffer3InfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    VkIndexType indexType;
} VkBindIndexBuffer3InfoKHR;

typedef struct VkBindVertexBuffer3InfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkBool32 setStride;
    VkStridedDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
} VkBindVertexBuffer3InfoKHR;

typedef struct VkDrawIndirect2InfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkStridedDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    uint32_t drawCount;
} VkDrawIndirect2InfoKHR;

typedef struct VkDrawIndirectCount2InfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkStridedDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    VkDeviceAddressRangeKHR countAddressRange;
    VkAddressCommandFlagsKHR countAddressFlags;
    uint32_t maxDrawCount;
} VkDrawIndirectCount2InfoKHR;

typedef struct VkDispatchIndirect2InfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
} VkDispatchIndirect2InfoKHR;

typedef struct VkConditionalRenderingBeginInfo2EXT {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    VkConditionalRenderingFlagsEXT flags;
} VkConditionalRenderingBeginInfo2EXT;

typedef struct VkBindTransformFeedbackBuffer2InfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
} VkBindTransformFeedbackBuffer2InfoEXT;

typedef struct VkMemoryMarkerInfoAMD {
    VkStructureType sType;
    const void *pNext;
    VkPipelineStageFlags2KHR stage;
    VkDeviceAddressRangeKHR dstRange;
    VkAddressCommandFlagsKHR dstFlags;
    uint32_t marker;
} VkMemoryMarkerInfoAMD;

typedef struct VkAccelerationStructureCreateInfo2KHR {
    VkStructureType sType;
    const void *pNext;
    VkAccelerationStructureCreateFlagsKHR createFlags;
    VkDeviceAddressRangeKHR addressRange;
    VkAddressCommandFlagsKHR addressFlags;
    VkAccelerationStructureTypeKHR type;
} VkAccelerationStructureCreateInfo2KHR;

typedef void(VKAPI_PTR *PFN_vkCmdBindIndexBuffer3KHR)(VkCommandBuffer commandBuffer,
                                                      const VkBindIndexBuffer3InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdBindVertexBuffers3KHR)(VkCommandBuffer commandBuffer, uint32_t firstBinding,
                                                        uint32_t bindingCount,
                                                        const VkBindVertexBuffer3InfoKHR *pBindingInfos);
typedef void(VKAPI_PTR *PFN_vkCmdDrawIndirect2KHR)(VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdDrawIndexedIndirect2KHR)(VkCommandBuffer commandBuffer,
                                                          const VkDrawIndirect2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdDispatchIndirect2KHR)(VkCommandBuffer commandBuffer,
                                                       const VkDispatchIndirect2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdCopyMemoryKHR)(VkCommandBuffer commandBuffer,
                                                const VkCopyDeviceMemoryInfoKHR *pCopyMemoryInfo);
typedef void(VKAPI_PTR *PFN_vkCmdCopyMemoryToImageKHR)(VkCommandBuffer commandBuffer,
                                                       const VkCopyDeviceMemoryImageInfoKHR *pCopyMemoryInfo);
typedef void(VKAPI_PTR *PFN_vkCmdCopyImageToMemoryKHR)(VkCommandBuffer commandBuffer,
                                                       const VkCopyDeviceMemoryImageInfoKHR *pCopyMemoryInfo);
typedef void(VKAPI_PTR *PFN_vkCmdUpdateMemoryKHR)(VkCommandBuffer commandBuffer,
                                                  const VkDeviceAddressRangeKHR *pDstRange,
                                                  VkAddressCommandFlagsKHR dstFlags, VkDeviceSize dataSize,
                                                  const void *pData);
typedef void(VKAPI_PTR *PFN_vkCmdFillMemoryKHR)(VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *pDstRange,
                                                VkAddressCommandFlagsKHR dstFlags, uint32_t data);
typedef void(VKAPI_PTR *PFN_vkCmdCopyQueryPoolResultsToMemoryKHR)(VkCommandBuffer commandBuffer, VkQueryPool queryPool,
                                                                  uint32_t firstQuery, uint32_t queryCount,
                                                                  const VkStridedDeviceAddressRangeKHR *pDstRange,
                                                                  VkAddressCommandFlagsKHR dstFlags,
                                                                  VkQueryResultFlags queryResultFlags);
typedef void(VKAPI_PTR *PFN_vkCmdDrawIndirectCount2KHR)(VkCommandBuffer commandBuffer,
                                                        const VkDrawIndirectCount2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdDrawIndexedIndirectCount2KHR)(VkCommandBuffer commandBuffer,
                                                               const VkDrawIndirectCount2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdBeginConditionalRendering2EXT)(
    VkCommandBuffer commandBuffer, const VkConditionalRenderingBeginInfo2EXT *pConditionalRenderingBegin);
typedef void(VKAPI_PTR *PFN_vkCmdBindTransformFeedbackBuffers2EXT)(
    VkCommandBuffer commandBuffer, uint32_t firstBinding, uint32_t bindingCount,
    const VkBindTransformFeedbackBuffer2InfoEXT *pBindingInfos);
typedef void(VKAPI_PTR *PFN_vkCmdBeginTransformFeedback2EXT)(
    VkCommandBuffer commandBuffer, uint32_t firstCounterRange, uint32_t counterRangeCount,
    const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfos);
typedef void(VKAPI_PTR *PFN_vkCmdEndTransformFeedback2EXT)(VkCommandBuffer commandBuffer, uint32_t firstCounterRange,
                                                           uint32_t counterRangeCount,
                                                           const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfos);
typedef void(VKAPI_PTR *PFN_vkCmdDrawIndirectByteCount2EXT)(VkCommandBuffer commandBuffer, uint32_t instanceCount,
                                                            uint32_t firstInstance,
                                                            const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfo,
                                                            uint32_t counterOffset, uint32_t vertexStride);
typedef void(VKAPI_PTR *PFN_vkCmdDrawMeshTasksIndirect2EXT)(VkCommandBuffer commandBuffer,
                                                            const VkDrawIndirect2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdDrawMeshTasksIndirectCount2EXT)(VkCommandBuffer commandBuffer,
                                                                 const VkDrawIndirectCount2InfoKHR *pInfo);
typedef void(VKAPI_PTR *PFN_vkCmdWriteMarkerToMemoryAMD)(VkCommandBuffer commandBuffer,
                                                         const VkMemoryMarkerInfoAMD *pInfo);
typedef VkResult(VKAPI_PTR *PFN_vkCreateAccelerationStructure2KHR)(
    VkDevice device, const VkAccelerationStructureCreateInfo2KHR *pCreateInfo, const VkAllocationCallbacks *pAllocator,
    VkAccelerationStructureKHR *pAccelerationStructure);

#ifndef VK_NO_PROTOTYPES
VKAPI_ATTR void VKAPI_CALL vkCmdBindIndexBuffer3KHR(VkCommandBuffer commandBuffer,
                                                    const VkBindIndexBuffer3InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdBindVertexBuffers3KHR(VkCommandBuffer commandBuffer, uint32_t firstBinding,
                                                      uint32_t bindingCount,
                                                      const VkBindVertexBuffer3InfoKHR *pBindingInfos);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndirect2KHR(VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexedIndirect2KHR(VkCommandBuffer commandBuffer,
                                                        const VkDrawIndirect2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdDispatchIndirect2KHR(VkCommandBuffer commandBuffer,
                                                     const VkDispatchIndirect2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdCopyMemoryKHR(VkCommandBuffer commandBuffer,
                                              const VkCopyDeviceMemoryInfoKHR *pCopyMemoryInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdCopyMemoryToImageKHR(VkCommandBuffer commandBuffer,
                                                     const VkCopyDeviceMemoryImageInfoKHR *pCopyMemoryInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdCopyImageToMemoryKHR(VkCommandBuffer commandBuffer,
                                                     const VkCopyDeviceMemoryImageInfoKHR *pCopyMemoryInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdUpdateMemoryKHR(VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *pDstRange,
                                                VkAddressCommandFlagsKHR dstFlags, VkDeviceSize dataSize,
                                                const void *pData);
VKAPI_ATTR void VKAPI_CALL vkCmdFillMemoryKHR(VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *pDstRange,
                                              VkAddressCommandFlagsKHR dstFlags, uint32_t data);
VKAPI_ATTR void VKAPI_CALL vkCmdCopyQueryPoolResultsToMemoryKHR(VkCommandBuffer commandBuffer, VkQueryPool queryPool,
                                                                uint32_t firstQuery, uint32_t queryCount,
                                                                const VkStridedDeviceAddressRangeKHR *pDstRange,
                                                                VkAddressCommandFlagsKHR dstFlags,
                                                                VkQueryResultFlags queryResultFlags);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndirectCount2KHR(VkCommandBuffer commandBuffer,
                                                      const VkDrawIndirectCount2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexedIndirectCount2KHR(VkCommandBuffer commandBuffer,
                                                             const VkDrawIndirectCount2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdBeginConditionalRendering2EXT(
    VkCommandBuffer commandBuffer, const VkConditionalRenderingBeginInfo2EXT *pConditionalRenderingBegin);
VKAPI_ATTR void VKAPI_CALL
vkCmdBindTransformFeedbackBuffers2EXT(VkCommandBuffer commandBuffer, uint32_t firstBinding, uint32_t bindingCount,
                                      const VkBindTransformFeedbackBuffer2InfoEXT *pBindingInfos);
VKAPI_ATTR void VKAPI_CALL vkCmdBeginTransformFeedback2EXT(VkCommandBuffer commandBuffer, uint32_t firstCounterRange,
                                                           uint32_t counterRangeCount,
                                                           const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfos);
VKAPI_ATTR void VKAPI_CALL vkCmdEndTransformFeedback2EXT(VkCommandBuffer commandBuffer, uint32_t firstCounterRange,
                                                         uint32_t counterRangeCount,
                                                         const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfos);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndirectByteCount2EXT(VkCommandBuffer commandBuffer, uint32_t instanceCount,
                                                          uint32_t firstInstance,
                                                          const VkBindTransformFeedbackBuffer2InfoEXT *pCounterInfo,
                                                          uint32_t counterOffset, uint32_t vertexStride);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawMeshTasksIndirect2EXT(VkCommandBuffer commandBuffer,
                                                          const VkDrawIndirect2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdDrawMeshTasksIndirectCount2EXT(VkCommandBuffer commandBuffer,
                                                               const VkDrawIndirectCount2InfoKHR *pInfo);
VKAPI_ATTR void VKAPI_CALL vkCmdWriteMarkerToMemoryAMD(VkCommandBuffer commandBuffer,
                                                       const VkMemoryMarkerInfoAMD *pInfo);
VKAPI_ATTR VkResult VKAPI_CALL vkCreateAccelerationStructure2KHR(
    VkDevice device, const VkAccelerationStructureCreateInfo2KHR *pCreateInfo, const VkAllocationCallbacks *pAllocator,
    VkAccelerationStructureKHR *pAccelerationStructure);
#endif
#endif // VK_KHR_device_address_commands

#ifndef VK_KHR_opacity_micromap
#define VK_KHR_opacity_micromap 1
#define VK_KHR_OPACITY_MICROMAP_SPEC_VERSION 1
#define VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME "VK_KHR_opacity_micromap"

#define VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR VELLUM_VULKAN_VALUE(VkStructureType, 1000623000)
#define VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR                                              \
    VELLUM_VULKAN_VALUE(VkStructureType, 1000623001)
#define VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR                                            \
    VELLUM_VULKAN_VALUE(VkStructureType, 1000623002)
#define VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR                                        \
    VELLUM_VULKAN_VALUE(VkStructureType, 1000623003)
#define VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR VELLUM_VULKAN_VALUE(VkPipelineCreateFlagBits, 0x1000000)
#define VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_BIT_KHR                                                    \
    VELLUM_VULKAN_VALUE(VkGeometryInstanceFlagBitsKHR, 0x10)
#define VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_BIT_KHR VELLUM_VULKAN_VALUE(VkGeometryInstanceFlagBitsKHR, 0x20)
#define VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR                                          \
    VELLUM_VULKAN_VALUE(VkBuildAccelerationStructureFlagBitsKHR, 0x40)
#define VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR                                        \
    VELLUM_VULKAN_VALUE(VkBuildAccelerationStructureFlagBitsKHR, 0x80)
#define VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR                                                         \
    VELLUM_VULKAN_VALUE(VkBuildAccelerationStructureFlagBitsKHR, 0x400)
#define VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR                                                            \
    VELLUM_VULKAN_VALUE(VkAccelerationStructureTypeKHR, 1000623000)
#define VK_GEOMETRY_TYPE_MICROMAP_KHR VELLUM_VULKAN_VALUE(VkGeometryTypeKHR, 1000623000)
static const VkFlags64 VK_PIPELINE_CREATE_2_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR = 0x1000000ULL;
static const VkFlags64 VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR = 0x20000000000ULL;
#define VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT VELLUM_VULKAN_VALUE(VkFlags, 0x1000)

typedef VkOpacityMicromapFormatEXT VkOpacityMicromapFormatKHR;
#define VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR VELLUM_VULKAN_VALUE(VkOpacityMicromapFormatKHR, 1)
#define VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR VELLUM_VULKAN_VALUE(VkOpacityMicromapFormatKHR, 2)

typedef VkOpacityMicromapSpecialIndexEXT VkOpacityMicromapSpecialIndexKHR;
#define VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_TRANSPARENT_KHR                                                        \
    VELLUM_VULKAN_VALUE(VkOpacityMicromapSpecialIndexKHR, -1)
#define VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_OPAQUE_KHR VELLUM_VULKAN_VALUE(VkOpacityMicromapSpecialIndexKHR, -2)
#define VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT_KHR                                                \
    VELLUM_VULKAN_VALUE(VkOpacityMicromapSpecialIndexKHR, -3)
#define VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE_KHR                                                     \
    VELLUM_VULKAN_VALUE(VkOpacityMicromapSpecialIndexKHR, -4)

typedef enum VkAccelerationStructureSerializedBlockTypeKHR {
    VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_OPACITY_MICROMAP_KHR = 0,
    VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_MAX_ENUM_KHR = 0x7FFFFFFF
} VkAccelerationStructureSerializedBlockTypeKHR;

typedef struct VkMicromapUsageKHR {
    uint32_t count;
    uint32_t subdivisionLevel;
    VkOpacityMicromapFormatKHR format;
} VkMicromapUsageKHR;

typedef struct VkMicromapTriangleKHR {
    uint32_t dataOffset;
    uint16_t subdivisionLevel;
    uint16_t format;
} VkMicromapTriangleKHR;

typedef struct VkAccelerationStructureGeometryMicromapDataKHR {
    VkStructureType sType;
    const void *pNext;
    uint32_t usageCountsCount;
    const VkMicromapUsageKHR *pUsageCounts;
    const VkMicromapUsageKHR *const *ppUsageCounts;
    VkDeviceAddress data;
    VkDeviceAddress triangleArray;
    VkDeviceSize triangleArrayStride;
} VkAccelerationStructureGeometryMicromapDataKHR;

typedef struct VkPhysicalDeviceOpacityMicromapFeaturesKHR {
    VkStructureType sType;
    void *pNext;
    VkBool32 micromap;
} VkPhysicalDeviceOpacityMicromapFeaturesKHR;

typedef struct VkPhysicalDeviceOpacityMicromapPropertiesKHR {
    VkStructureType sType;
    void *pNext;
    uint32_t maxOpacity2StateSubdivisionLevel;
    uint32_t maxOpacity4StateSubdivisionLevel;
    uint32_t maxOpacityLossy4StateSubdivisionLevel;
    uint64_t maxMicromapTriangles;
} VkPhysicalDeviceOpacityMicromapPropertiesKHR;

typedef struct VkAccelerationStructureTrianglesOpacityMicromapKHR {
    VkStructureType sType;
    void *pNext;
    VkIndexType indexType;
    VkDeviceAddress indexBuffer;
    VkDeviceSize indexStride;
    uint32_t baseTriangle;
    VkAccelerationStructureKHR micromap;
} VkAccelerationStructureTrianglesOpacityMicromapKHR;

#endif // VK_KHR_opacity_micromap

#ifdef __cplusplus
}
#endif

#endif
