// SPDX-License-Identifier: Apache-2.0
// Declarations of Vulkan that are newer than the oldest headers Vellum builds with (1.3.239). They have names of their
// own, so that they compile beside headers that have them. The extensions that Vellum provides are in its public
// header. Layouts and values: vk.xml of KhronosGroup/Vulkan-Docs.
#pragma once

#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::newer
{

// VK_KHR_maintenance5 (core in 1.4)
inline constexpr auto kBufferUsageFlags2CreateInfo = static_cast<VkStructureType>(1000470006);
inline constexpr auto kPipelineCreateFlags2CreateInfo = static_cast<VkStructureType>(1000470005);
struct BufferUsageFlags2CreateInfo {
    VkStructureType sType;
    const void *pNext;
    VkFlags64 usage;
};
struct PipelineCreateFlags2CreateInfo {
    VkStructureType sType;
    const void *pNext;
    VkFlags64 flags;
};

using PFN_CmdBindIndexBuffer2 = void(VKAPI_PTR *)(VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, VkIndexType);

// VK_KHR_maintenance6 (core in 1.4)
inline constexpr auto kMaintenance6Features = static_cast<VkStructureType>(1000545000);
struct Maintenance6Features {
    VkStructureType sType;
    void *pNext;
    VkBool32 maintenance6;
};
inline constexpr auto kVulkan14Features = static_cast<VkStructureType>(55);
struct Vulkan14Features {
    VkStructureType sType;
    void *pNext;
    VkBool32 before[15]; // globalPriorityQuery to dynamicRenderingLocalRead
    VkBool32 maintenance5;
    VkBool32 maintenance6;
    VkBool32 after[4]; // pipelineProtectedAccess to pushDescriptor
};
struct PushConstantsInfo {
    VkStructureType sType;
    const void *pNext;
    VkPipelineLayout layout;
    VkShaderStageFlags stageFlags;
    uint32_t offset;
    uint32_t size;
    const void *pValues;
};
using PFN_CmdPushConstants2 = void(VKAPI_PTR *)(VkCommandBuffer, const PushConstantsInfo *);
struct BindDescriptorSetsInfo {
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
using PFN_CmdBindDescriptorSets2 = void(VKAPI_PTR *)(VkCommandBuffer, const BindDescriptorSetsInfo *);
struct PushDescriptorSetInfo {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags stageFlags;
    VkPipelineLayout layout;
    uint32_t set;
    uint32_t descriptorWriteCount;
    const VkWriteDescriptorSet *pDescriptorWrites;
};
using PFN_CmdPushDescriptorSet2 = void(VKAPI_PTR *)(VkCommandBuffer, const PushDescriptorSetInfo *);
struct PushDescriptorSetWithTemplateInfo {
    VkStructureType sType;
    const void *pNext;
    VkDescriptorUpdateTemplate descriptorUpdateTemplate;
    VkPipelineLayout layout;
    uint32_t set;
    const void *pData;
};
using PFN_CmdPushDescriptorSetWithTemplate2 = void(VKAPI_PTR *)(VkCommandBuffer,
                                                                const PushDescriptorSetWithTemplateInfo *);

// VK_ARM_pipeline_opacity_micromap
inline constexpr const char *kPipelineOpacityMicromapExtension = "VK_ARM_pipeline_opacity_micromap";
inline constexpr auto kPipelineOpacityMicromapFeatures = static_cast<VkStructureType>(1000596000);
inline constexpr VkFlags64 kPipelineDisallowOpacityMicromap = VkFlags64{1} << 37;
struct PipelineOpacityMicromapFeatures {
    VkStructureType sType;
    void *pNext;
    VkBool32 pipelineOpacityMicromap;
};

// VK_NV_displacement_micromap, which headers have only with VK_ENABLE_BETA_EXTENSIONS
inline constexpr const char *kDisplacementMicromapExtension = "VK_NV_displacement_micromap";
inline constexpr auto kDisplacementMicromapFeatures = static_cast<VkStructureType>(1000397000);
inline constexpr auto kDisplacementMicromapProperties = static_cast<VkStructureType>(1000397001);
inline constexpr auto kTrianglesDisplacementMicromap = static_cast<VkStructureType>(1000397002);
struct DisplacementMicromapProperties {
    VkStructureType sType;
    void *pNext;
    uint32_t maxDisplacementMicromapSubdivisionLevel;
};

// VK_KHR_maintenance6
inline constexpr auto kBindMemoryStatus = static_cast<VkStructureType>(1000545002);
struct BindMemoryStatus {
    VkStructureType sType;
    const void *pNext;
    VkResult *pResult;
};

// VK_KHR_map_memory2 (core in 1.4)
struct MemoryMapInfo {
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkDeviceMemory memory;
    VkDeviceSize offset;
    VkDeviceSize size;
};
struct MemoryUnmapInfo {
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkDeviceMemory memory;
};
using PFN_MapMemory2 = VkResult(VKAPI_PTR *)(VkDevice, const MemoryMapInfo *, void **);
using PFN_UnmapMemory2 = VkResult(VKAPI_PTR *)(VkDevice, const MemoryUnmapInfo *);

// VK_EXT_shader_object
struct Shader_T;
using ShaderEXT = Shader_T *;
struct ShaderCreateInfo {
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkShaderStageFlagBits stage;
    VkShaderStageFlags nextStage;
    int codeType; // VkShaderCodeTypeEXT
    size_t codeSize;
    const void *pCode;
    const char *pName;
    uint32_t setLayoutCount;
    const VkDescriptorSetLayout *pSetLayouts;
    uint32_t pushConstantRangeCount;
    const VkPushConstantRange *pPushConstantRanges;
    const VkSpecializationInfo *pSpecializationInfo;
};
inline constexpr int kShaderCodeTypeSpirv = 1;
using PFN_CreateShaders = VkResult(VKAPI_PTR *)(VkDevice, uint32_t, const ShaderCreateInfo *,
                                                const VkAllocationCallbacks *, ShaderEXT *);
inline constexpr int kShaderCodeTypeBinary = 0;
inline constexpr auto kIncompatibleShaderBinary = static_cast<VkResult>(1000482000);
inline constexpr auto kShaderObjectProperties = static_cast<VkStructureType>(1000482001);
struct ShaderObjectProperties {
    VkStructureType sType;
    void *pNext;
    uint8_t shaderBinaryUUID[VK_UUID_SIZE];
    uint32_t shaderBinaryVersion;
};
using PFN_GetShaderBinaryData = VkResult(VKAPI_PTR *)(VkDevice, ShaderEXT, size_t *, void *);
using PFN_DestroyShader = void(VKAPI_PTR *)(VkDevice, ShaderEXT, const VkAllocationCallbacks *);
using PFN_CmdBindShaders = void(VKAPI_PTR *)(VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *,
                                             const ShaderEXT *);

// VK_KHR_pipeline_binary
inline constexpr const char *kPipelineBinaryExtension = "VK_KHR_pipeline_binary";
inline constexpr auto kPipelineBinaryInfo = static_cast<VkStructureType>(1000483002);
inline constexpr auto kPipelineBinaryMissing = static_cast<VkResult>(1000483000);
inline constexpr auto kNotEnoughSpace = static_cast<VkResult>(-1000483000);
inline constexpr uint32_t kMaxPipelineBinaryKeySize = 32;
struct PipelineBinary_T;
using PipelineBinary = PipelineBinary_T *;
struct PipelineBinaryKey {
    VkStructureType sType;
    void *pNext;
    uint32_t keySize;
    uint8_t key[kMaxPipelineBinaryKeySize];
};
struct PipelineBinaryData {
    size_t dataSize;
    void *pData;
};
struct PipelineBinaryKeysAndData {
    uint32_t binaryCount;
    const PipelineBinaryKey *pPipelineBinaryKeys;
    const PipelineBinaryData *pPipelineBinaryData;
};
struct PipelineCreateInfo {
    VkStructureType sType;
    void *pNext; // the create info of a pipeline
};
struct PipelineBinaryCreateInfo {
    VkStructureType sType;
    const void *pNext;
    const PipelineBinaryKeysAndData *pKeysAndDataInfo;
    VkPipeline pipeline;
    const PipelineCreateInfo *pPipelineCreateInfo;
};
struct PipelineBinaryInfo {
    VkStructureType sType;
    const void *pNext;
    uint32_t binaryCount;
    const PipelineBinary *pPipelineBinaries;
};
struct PipelineBinaryDataInfo {
    VkStructureType sType;
    void *pNext;
    PipelineBinary pipelineBinary;
};
struct PipelineBinaryHandlesInfo {
    VkStructureType sType;
    const void *pNext;
    uint32_t pipelineBinaryCount;
    PipelineBinary *pPipelineBinaries;
};
using PFN_CreatePipelineBinaries = VkResult(VKAPI_PTR *)(VkDevice, const PipelineBinaryCreateInfo *,
                                                         const VkAllocationCallbacks *, PipelineBinaryHandlesInfo *);
using PFN_DestroyPipelineBinary = void(VKAPI_PTR *)(VkDevice, PipelineBinary, const VkAllocationCallbacks *);
using PFN_GetPipelineKey = VkResult(VKAPI_PTR *)(VkDevice, const PipelineCreateInfo *, PipelineBinaryKey *);
using PFN_GetPipelineBinaryData = VkResult(VKAPI_PTR *)(VkDevice, const PipelineBinaryDataInfo *, PipelineBinaryKey *,
                                                        size_t *, void *);

// VK_ARM_tensors
inline constexpr auto kTensorMemoryBarrier = static_cast<VkStructureType>(1000460008);
struct TensorMemoryBarrier {
    VkStructureType sType;
    const void *pNext;
    VkPipelineStageFlags2 srcStageMask;
    VkAccessFlags2 srcAccessMask;
    VkPipelineStageFlags2 dstStageMask;
    VkAccessFlags2 dstAccessMask;
    uint32_t srcQueueFamilyIndex;
    uint32_t dstQueueFamilyIndex;
    uint64_t tensor; // VkTensorARM
};
inline constexpr auto kTensorDependencyInfo = static_cast<VkStructureType>(1000460013);
struct TensorDependencyInfo {
    VkStructureType sType;
    const void *pNext;
    uint32_t tensorMemoryBarrierCount;
    const TensorMemoryBarrier *pTensorMemoryBarriers;
};

// VK_KHR_internally_synchronized_queues
inline constexpr auto kQueueInternallySynchronized = static_cast<VkDeviceQueueCreateFlagBits>(4);

// VK_QCOM_queue_perf_hint
using PFN_QueueSetPerfHint = VkResult(VKAPI_PTR *)(VkQueue, const void *);

// VK_EXT_layer_settings
inline constexpr const char *kLayerSettingsExtension = "VK_EXT_layer_settings";
inline constexpr auto kLayerSettingsCreateInfo = static_cast<VkStructureType>(1000496000);
enum LayerSettingType { kLayerSettingBool32 = 0, kLayerSettingUint32 = 3, kLayerSettingString = 8 };
struct LayerSetting {
    const char *pLayerName;
    const char *pSettingName;
    int type; // VkLayerSettingTypeEXT
    uint32_t valueCount;
    const void *pValues;
};
struct LayerSettingsCreateInfo {
    VkStructureType sType;
    const void *pNext;
    uint32_t settingCount;
    const LayerSetting *pSettings;
};

} // namespace vellum::newer
