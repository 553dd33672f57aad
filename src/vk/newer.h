// SPDX-License-Identifier: Apache-2.0
// Written by src/vk/registry.py from Vulkan's registry 1.4.360.
// Vulkan's headers, and what of newer ones Vellum uses.
#pragma once

#include "vellum/vulkan_opacity_micromap.h"

// clang-format off
#ifndef VK_KHR_maintenance5
using VkBufferUsageFlags2KHR = VkFlags64;
inline constexpr VkStructureType VK_STRUCTURE_TYPE_BUFFER_USAGE_FLAGS_2_CREATE_INFO_KHR = static_cast<VkStructureType>(1000470006);
struct VkBufferUsageFlags2CreateInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkBufferUsageFlags2KHR usage;
};
using VkPipelineCreateFlags2KHR = VkFlags64;
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR = static_cast<VkStructureType>(1000470005);
struct VkPipelineCreateFlags2CreateInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkPipelineCreateFlags2KHR flags;
};
using PFN_vkCmdBindIndexBuffer2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size, VkIndexType indexType);
#endif

#ifndef VK_KHR_maintenance6
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_6_FEATURES_KHR = static_cast<VkStructureType>(1000545000);
struct VkPhysicalDeviceMaintenance6FeaturesKHR {
    VkStructureType sType;
    void *pNext;
    VkBool32 maintenance6;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_BIND_MEMORY_STATUS_KHR = static_cast<VkStructureType>(1000545002);
struct VkBindMemoryStatusKHR {
    VkStructureType sType;
    const void *pNext;
    VkResult *pResult;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PUSH_CONSTANTS_INFO_KHR = static_cast<VkStructureType>(1000545004);
struct VkPushConstantsInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkPipelineLayout layout;
    VkShaderStageFlags stageFlags;
    uint32_t offset;
    uint32_t size;
    const void *pValues;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_BIND_DESCRIPTOR_SETS_INFO_KHR = static_cast<VkStructureType>(1000545003);
struct VkBindDescriptorSetsInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags stageFlags;
    VkPipelineLayout layout;
    uint32_t firstSet;
    uint32_t descriptorSetCount;
    const VkDescriptorSet *pDescriptorSets;
    uint32_t dynamicOffsetCount;
    const uint32_t *pDynamicOffsets;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PUSH_DESCRIPTOR_SET_INFO_KHR = static_cast<VkStructureType>(1000545005);
struct VkPushDescriptorSetInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags stageFlags;
    VkPipelineLayout layout;
    uint32_t set;
    uint32_t descriptorWriteCount;
    const VkWriteDescriptorSet *pDescriptorWrites;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PUSH_DESCRIPTOR_SET_WITH_TEMPLATE_INFO_KHR = static_cast<VkStructureType>(1000545006);
struct VkPushDescriptorSetWithTemplateInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkDescriptorUpdateTemplate descriptorUpdateTemplate;
    VkPipelineLayout layout;
    uint32_t set;
    const void *pData;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_SET_DESCRIPTOR_BUFFER_OFFSETS_INFO_EXT = static_cast<VkStructureType>(1000545007);
struct VkSetDescriptorBufferOffsetsInfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags stageFlags;
    VkPipelineLayout layout;
    uint32_t firstSet;
    uint32_t setCount;
    const uint32_t *pBufferIndices;
    const VkDeviceSize *pOffsets;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_BIND_DESCRIPTOR_BUFFER_EMBEDDED_SAMPLERS_INFO_EXT = static_cast<VkStructureType>(1000545008);
struct VkBindDescriptorBufferEmbeddedSamplersInfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags stageFlags;
    VkPipelineLayout layout;
    uint32_t set;
};
using PFN_vkCmdPushConstants2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkPushConstantsInfoKHR *pPushConstantsInfo);
using PFN_vkCmdBindDescriptorSets2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkBindDescriptorSetsInfoKHR *pBindDescriptorSetsInfo);
using PFN_vkCmdPushDescriptorSet2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkPushDescriptorSetInfoKHR *pPushDescriptorSetInfo);
using PFN_vkCmdPushDescriptorSetWithTemplate2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkPushDescriptorSetWithTemplateInfoKHR *pPushDescriptorSetWithTemplateInfo);
using PFN_vkCmdSetDescriptorBufferOffsets2EXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkSetDescriptorBufferOffsetsInfoEXT *pSetDescriptorBufferOffsetsInfo);
using PFN_vkCmdBindDescriptorBufferEmbeddedSamplers2EXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkBindDescriptorBufferEmbeddedSamplersInfoEXT *pBindDescriptorBufferEmbeddedSamplersInfo);
#endif

#ifndef VK_VERSION_1_4
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_4_FEATURES = static_cast<VkStructureType>(55);
struct VkPhysicalDeviceVulkan14Features {
    VkStructureType sType;
    void *pNext;
    VkBool32 globalPriorityQuery;
    VkBool32 shaderSubgroupRotate;
    VkBool32 shaderSubgroupRotateClustered;
    VkBool32 shaderFloatControls2;
    VkBool32 shaderExpectAssume;
    VkBool32 rectangularLines;
    VkBool32 bresenhamLines;
    VkBool32 smoothLines;
    VkBool32 stippledRectangularLines;
    VkBool32 stippledBresenhamLines;
    VkBool32 stippledSmoothLines;
    VkBool32 vertexAttributeInstanceRateDivisor;
    VkBool32 vertexAttributeInstanceRateZeroDivisor;
    VkBool32 indexTypeUint8;
    VkBool32 dynamicRenderingLocalRead;
    VkBool32 maintenance5;
    VkBool32 maintenance6;
    VkBool32 pipelineProtectedAccess;
    VkBool32 pipelineRobustness;
    VkBool32 hostImageCopy;
    VkBool32 pushDescriptor;
};
#endif

#ifndef VK_KHR_map_memory2
inline constexpr VkStructureType VK_STRUCTURE_TYPE_MEMORY_MAP_INFO_KHR = static_cast<VkStructureType>(1000271000);
struct VkMemoryMapInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkMemoryMapFlags flags;
    VkDeviceMemory memory;
    VkDeviceSize offset;
    VkDeviceSize size;
};
using VkMemoryUnmapFlagsKHR = VkFlags;
inline constexpr VkStructureType VK_STRUCTURE_TYPE_MEMORY_UNMAP_INFO_KHR = static_cast<VkStructureType>(1000271001);
struct VkMemoryUnmapInfoKHR {
    VkStructureType sType;
    const void *pNext;
    VkMemoryUnmapFlagsKHR flags;
    VkDeviceMemory memory;
};
using PFN_vkMapMemory2KHR = VkResult(VKAPI_PTR *)(VkDevice device, const VkMemoryMapInfoKHR *pMemoryMapInfo, void **ppData);
using PFN_vkUnmapMemory2KHR = VkResult(VKAPI_PTR *)(VkDevice device, const VkMemoryUnmapInfoKHR *pMemoryUnmapInfo);
#endif

#ifndef VK_EXT_shader_object
VK_DEFINE_NON_DISPATCHABLE_HANDLE(VkShaderEXT)
enum VkShaderCodeTypeEXT : int {
    VK_SHADER_CODE_TYPE_BINARY_EXT = 0,
    VK_SHADER_CODE_TYPE_SPIRV_EXT = 1,
};
using VkShaderCreateFlagsEXT = VkFlags;
inline constexpr VkStructureType VK_STRUCTURE_TYPE_SHADER_CREATE_INFO_EXT = static_cast<VkStructureType>(1000482002);
struct VkShaderCreateInfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkShaderCreateFlagsEXT flags;
    VkShaderStageFlagBits stage;
    VkShaderStageFlags nextStage;
    VkShaderCodeTypeEXT codeType;
    size_t codeSize;
    const void *pCode;
    const char *pName;
    uint32_t setLayoutCount;
    const VkDescriptorSetLayout *pSetLayouts;
    uint32_t pushConstantRangeCount;
    const VkPushConstantRange *pPushConstantRanges;
    const VkSpecializationInfo *pSpecializationInfo;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_OBJECT_PROPERTIES_EXT = static_cast<VkStructureType>(1000482001);
struct VkPhysicalDeviceShaderObjectPropertiesEXT {
    VkStructureType sType;
    void *pNext;
    uint8_t shaderBinaryUUID[VK_UUID_SIZE];
    uint32_t shaderBinaryVersion;
};
inline constexpr VkResult VK_INCOMPATIBLE_SHADER_BINARY_EXT = static_cast<VkResult>(1000482000);
using PFN_vkCreateShadersEXT = VkResult(VKAPI_PTR *)(VkDevice device, uint32_t createInfoCount, const VkShaderCreateInfoEXT *pCreateInfos, const VkAllocationCallbacks *pAllocator, VkShaderEXT *pShaders);
using PFN_vkDestroyShaderEXT = void(VKAPI_PTR *)(VkDevice device, VkShaderEXT shader, const VkAllocationCallbacks *pAllocator);
using PFN_vkGetShaderBinaryDataEXT = VkResult(VKAPI_PTR *)(VkDevice device, VkShaderEXT shader, size_t *pDataSize, void *pData);
using PFN_vkCmdBindShadersEXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, uint32_t stageCount, const VkShaderStageFlagBits *pStages, const VkShaderEXT *pShaders);
#endif

#ifndef VK_KHR_pipeline_binary
#define VK_KHR_PIPELINE_BINARY_EXTENSION_NAME "VK_KHR_pipeline_binary"
inline constexpr uint32_t VK_MAX_PIPELINE_BINARY_KEY_SIZE_KHR = 32;
inline constexpr VkResult VK_PIPELINE_BINARY_MISSING_KHR = static_cast<VkResult>(1000483000);
inline constexpr VkResult VK_ERROR_NOT_ENOUGH_SPACE_KHR = static_cast<VkResult>(-1000483000);
VK_DEFINE_NON_DISPATCHABLE_HANDLE(VkPipelineBinaryKHR)
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_BINARY_FEATURES_KHR = static_cast<VkStructureType>(1000483000);
struct VkPhysicalDevicePipelineBinaryFeaturesKHR {
    VkStructureType sType;
    void *pNext;
    VkBool32 pipelineBinaries;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_BINARY_PROPERTIES_KHR = static_cast<VkStructureType>(1000483004);
struct VkPhysicalDevicePipelineBinaryPropertiesKHR {
    VkStructureType sType;
    void *pNext;
    VkBool32 pipelineBinaryInternalCache;
    VkBool32 pipelineBinaryInternalCacheControl;
    VkBool32 pipelineBinaryPrefersInternalCache;
    VkBool32 pipelineBinaryPrecompiledInternalCache;
    VkBool32 pipelineBinaryCompressedData;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_BINARY_KEY_KHR = static_cast<VkStructureType>(1000483003);
struct VkPipelineBinaryKeyKHR {
    VkStructureType sType;
    void *pNext;
    uint32_t keySize;
    uint8_t key[VK_MAX_PIPELINE_BINARY_KEY_SIZE_KHR];
};
struct VkPipelineBinaryDataKHR {
    size_t dataSize;
    void *pData;
};
struct VkPipelineBinaryKeysAndDataKHR {
    uint32_t binaryCount;
    const VkPipelineBinaryKeyKHR *pPipelineBinaryKeys;
    const VkPipelineBinaryDataKHR *pPipelineBinaryData;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_CREATE_INFO_KHR = static_cast<VkStructureType>(1000483007);
struct VkPipelineCreateInfoKHR {
    VkStructureType sType;
    void *pNext;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_BINARY_CREATE_INFO_KHR = static_cast<VkStructureType>(1000483001);
struct VkPipelineBinaryCreateInfoKHR {
    VkStructureType sType;
    const void *pNext;
    const VkPipelineBinaryKeysAndDataKHR *pKeysAndDataInfo;
    VkPipeline pipeline;
    const VkPipelineCreateInfoKHR *pPipelineCreateInfo;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_BINARY_INFO_KHR = static_cast<VkStructureType>(1000483002);
struct VkPipelineBinaryInfoKHR {
    VkStructureType sType;
    const void *pNext;
    uint32_t binaryCount;
    const VkPipelineBinaryKHR *pPipelineBinaries;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_BINARY_DATA_INFO_KHR = static_cast<VkStructureType>(1000483006);
struct VkPipelineBinaryDataInfoKHR {
    VkStructureType sType;
    void *pNext;
    VkPipelineBinaryKHR pipelineBinary;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR = static_cast<VkStructureType>(1000483009);
struct VkPipelineBinaryHandlesInfoKHR {
    VkStructureType sType;
    const void *pNext;
    uint32_t pipelineBinaryCount;
    VkPipelineBinaryKHR *pPipelineBinaries;
};
using PFN_vkCreatePipelineBinariesKHR = VkResult(VKAPI_PTR *)(VkDevice device, const VkPipelineBinaryCreateInfoKHR *pCreateInfo, const VkAllocationCallbacks *pAllocator, VkPipelineBinaryHandlesInfoKHR *pBinaries);
using PFN_vkDestroyPipelineBinaryKHR = void(VKAPI_PTR *)(VkDevice device, VkPipelineBinaryKHR pipelineBinary, const VkAllocationCallbacks *pAllocator);
using PFN_vkGetPipelineKeyKHR = VkResult(VKAPI_PTR *)(VkDevice device, const VkPipelineCreateInfoKHR *pPipelineCreateInfo, VkPipelineBinaryKeyKHR *pPipelineKey);
using PFN_vkGetPipelineBinaryDataKHR = VkResult(VKAPI_PTR *)(VkDevice device, const VkPipelineBinaryDataInfoKHR *pInfo, VkPipelineBinaryKeyKHR *pPipelineBinaryKey, size_t *pPipelineBinaryDataSize, void *pPipelineBinaryData);
#endif

#ifndef VK_EXT_descriptor_heap
#define VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME "VK_EXT_descriptor_heap"
struct VkHostAddressRangeConstEXT {
    const void *address;
    size_t size;
};
struct VkDeviceAddressRangeEXT {
    VkDeviceAddress address;
    VkDeviceSize size;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_BIND_HEAP_INFO_EXT = static_cast<VkStructureType>(1000135003);
struct VkBindHeapInfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkDeviceAddressRangeEXT heapRange;
    VkDeviceSize reservedRangeOffset;
    VkDeviceSize reservedRangeSize;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PUSH_DATA_INFO_EXT = static_cast<VkStructureType>(1000135004);
struct VkPushDataInfoEXT {
    VkStructureType sType;
    const void *pNext;
    uint32_t offset;
    VkHostAddressRangeConstEXT data;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_HEAP_FEATURES_EXT = static_cast<VkStructureType>(1000135009);
struct VkPhysicalDeviceDescriptorHeapFeaturesEXT {
    VkStructureType sType;
    void *pNext;
    VkBool32 descriptorHeap;
    VkBool32 descriptorHeapCaptureReplay;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_DESCRIPTOR_HEAP_INFO_EXT = static_cast<VkStructureType>(1000135010);
struct VkCommandBufferInheritanceDescriptorHeapInfoEXT {
    VkStructureType sType;
    const void *pNext;
    const VkBindHeapInfoEXT *pSamplerHeapBindInfo;
    const VkBindHeapInfoEXT *pResourceHeapBindInfo;
};
inline constexpr VkFlags64 VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT = static_cast<VkFlags64>(68719476736);
using PFN_vkCmdBindSamplerHeapEXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkBindHeapInfoEXT *pBindInfo);
using PFN_vkCmdBindResourceHeapEXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkBindHeapInfoEXT *pBindInfo);
using PFN_vkCmdPushDataEXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkPushDataInfoEXT *pPushDataInfo);
#endif

#ifndef VK_ARM_tensors
VK_DEFINE_NON_DISPATCHABLE_HANDLE(VkTensorARM)
inline constexpr VkStructureType VK_STRUCTURE_TYPE_TENSOR_MEMORY_BARRIER_ARM = static_cast<VkStructureType>(1000460008);
struct VkTensorMemoryBarrierARM {
    VkStructureType sType;
    const void *pNext;
    VkPipelineStageFlags2 srcStageMask;
    VkAccessFlags2 srcAccessMask;
    VkPipelineStageFlags2 dstStageMask;
    VkAccessFlags2 dstAccessMask;
    uint32_t srcQueueFamilyIndex;
    uint32_t dstQueueFamilyIndex;
    VkTensorARM tensor;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_TENSOR_DEPENDENCY_INFO_ARM = static_cast<VkStructureType>(1000460013);
struct VkTensorDependencyInfoARM {
    VkStructureType sType;
    const void *pNext;
    uint32_t tensorMemoryBarrierCount;
    const VkTensorMemoryBarrierARM *pTensorMemoryBarriers;
};
#endif

#ifndef VK_ARM_pipeline_opacity_micromap
#define VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME "VK_ARM_pipeline_opacity_micromap"
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM = static_cast<VkStructureType>(1000596000);
struct VkPhysicalDevicePipelineOpacityMicromapFeaturesARM {
    VkStructureType sType;
    void *pNext;
    VkBool32 pipelineOpacityMicromap;
};
inline constexpr VkFlags64 VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM = static_cast<VkFlags64>(137438953472);
#endif

#ifndef VK_NV_displacement_micromap
#define VK_NV_DISPLACEMENT_MICROMAP_EXTENSION_NAME "VK_NV_displacement_micromap"
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV = static_cast<VkStructureType>(1000397000);
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_PROPERTIES_NV = static_cast<VkStructureType>(1000397001);
struct VkPhysicalDeviceDisplacementMicromapPropertiesNV {
    VkStructureType sType;
    void *pNext;
    uint32_t maxDisplacementMicromapSubdivisionLevel;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_DISPLACEMENT_MICROMAP_NV = static_cast<VkStructureType>(1000397002);
#endif

#ifndef VK_KHR_internally_synchronized_queues
inline constexpr VkDeviceQueueCreateFlagBits VK_DEVICE_QUEUE_CREATE_INTERNALLY_SYNCHRONIZED_BIT_KHR = static_cast<VkDeviceQueueCreateFlagBits>(4);
#endif

#ifndef VK_QCOM_queue_perf_hint
enum VkPerfHintTypeQCOM : int {
    VK_PERF_HINT_TYPE_DEFAULT_QCOM = 0,
    VK_PERF_HINT_TYPE_FREQUENCY_MIN_QCOM = 1,
    VK_PERF_HINT_TYPE_FREQUENCY_MAX_QCOM = 2,
    VK_PERF_HINT_TYPE_FREQUENCY_SCALED_QCOM = 3,
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_PERF_HINT_INFO_QCOM = static_cast<VkStructureType>(1000302000);
struct VkPerfHintInfoQCOM {
    VkStructureType sType;
    void *pNext;
    VkPerfHintTypeQCOM type;
    uint32_t scale;
};
using PFN_vkQueueSetPerfHintQCOM = VkResult(VKAPI_PTR *)(VkQueue queue, const VkPerfHintInfoQCOM *pPerfHintInfo);
#endif

#ifndef VK_EXT_layer_settings
#define VK_EXT_LAYER_SETTINGS_EXTENSION_NAME "VK_EXT_layer_settings"
enum VkLayerSettingTypeEXT : int {
    VK_LAYER_SETTING_TYPE_BOOL32_EXT = 0,
    VK_LAYER_SETTING_TYPE_INT32_EXT = 1,
    VK_LAYER_SETTING_TYPE_INT64_EXT = 2,
    VK_LAYER_SETTING_TYPE_UINT32_EXT = 3,
    VK_LAYER_SETTING_TYPE_UINT64_EXT = 4,
    VK_LAYER_SETTING_TYPE_FLOAT32_EXT = 5,
    VK_LAYER_SETTING_TYPE_FLOAT64_EXT = 6,
    VK_LAYER_SETTING_TYPE_STRING_EXT = 7,
};
struct VkLayerSettingEXT {
    const char *pLayerName;
    const char *pSettingName;
    VkLayerSettingTypeEXT type;
    uint32_t valueCount;
    const void *pValues;
};
inline constexpr VkStructureType VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT = static_cast<VkStructureType>(1000496000);
struct VkLayerSettingsCreateInfoEXT {
    VkStructureType sType;
    const void *pNext;
    uint32_t settingCount;
    const VkLayerSettingEXT *pSettings;
};
#endif

#ifndef VK_EXT_device_generated_commands
VK_DEFINE_NON_DISPATCHABLE_HANDLE(VkIndirectExecutionSetEXT)
VK_DEFINE_NON_DISPATCHABLE_HANDLE(VkIndirectCommandsLayoutEXT)
inline constexpr VkStructureType VK_STRUCTURE_TYPE_GENERATED_COMMANDS_INFO_EXT = static_cast<VkStructureType>(1000572004);
struct VkGeneratedCommandsInfoEXT {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags shaderStages;
    VkIndirectExecutionSetEXT indirectExecutionSet;
    VkIndirectCommandsLayoutEXT indirectCommandsLayout;
    VkDeviceAddress indirectAddress;
    VkDeviceSize indirectAddressSize;
    VkDeviceAddress preprocessAddress;
    VkDeviceSize preprocessSize;
    uint32_t maxSequenceCount;
    VkDeviceAddress sequenceCountAddress;
    uint32_t maxDrawCount;
};
using PFN_vkCmdExecuteGeneratedCommandsEXT = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, VkBool32 isPreprocessed, const VkGeneratedCommandsInfoEXT *pGeneratedCommandsInfo);
#endif

#ifndef VK_NV_device_generated_commands_compute
using PFN_vkGetPipelineIndirectMemoryRequirementsNV = void(VKAPI_PTR *)(VkDevice device, const VkComputePipelineCreateInfo *pCreateInfo, VkMemoryRequirements2 *pMemoryRequirements);
#endif

#ifndef VK_QCOM_tile_shading
inline constexpr VkStructureType VK_STRUCTURE_TYPE_DISPATCH_TILE_INFO_QCOM = static_cast<VkStructureType>(1000309005);
struct VkDispatchTileInfoQCOM {
    VkStructureType sType;
    const void *pNext;
};
using PFN_vkCmdDispatchTileQCOM = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkDispatchTileInfoQCOM *pDispatchTileInfo);
#endif

#ifndef VK_KHR_maintenance10
inline constexpr VkStructureType VK_STRUCTURE_TYPE_RENDERING_END_INFO_KHR = static_cast<VkStructureType>(1000619003);
struct VkRenderingEndInfoKHR {
    VkStructureType sType;
    const void *pNext;
};
using PFN_vkCmdEndRendering2KHR = void(VKAPI_PTR *)(VkCommandBuffer commandBuffer, const VkRenderingEndInfoKHR *pRenderingEndInfo);
#endif

// clang-format on
