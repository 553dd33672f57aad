// SPDX-License-Identifier: Apache-2.0
// The quirks "alignments", "push128", "compute", "few" and "noqueries": limits and features at the ends of what the
// specification allows. Recorded commands are checked against them.
#include "layers/driver.h"

#include <map>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Limits;

// Required Limits: at most, of these alignments; at least, of maxShaderGroupStride and maxPushConstantsSize.
constexpr uint32_t kScratchAlignment = 256, kHandleAlignment = 32, kTableAlignment = 64, kMostStride = 4096;
constexpr VkDeviceSize kMostAtom = 256, kMostOffset = 256;
constexpr uint32_t kPushBytes = 128;
constexpr uint32_t kInvocations = 128, kGroups = 65535, kSharedBytes = 16384;

bool aligns(void *key)
{
    return has(key, "alignments");
}
bool pushesLittle(void *key)
{
    return has(key, "push128");
}

bool computesLittle(void *key)
{
    return has(key, "compute");
}

void setLimits(void *key, VkPhysicalDeviceLimits &limits)
{
    if (computesLittle(key)) {
        limits.maxComputeWorkGroupInvocations = kInvocations;
        limits.maxComputeSharedMemorySize = kSharedBytes;
        for (size_t i = 0; i < 3; ++i) {
            limits.maxComputeWorkGroupSize[i] = i < 2 ? 128 : 64;
            limits.maxComputeWorkGroupCount[i] = kGroups;
        }
    }
    if (pushesLittle(key))
        limits.maxPushConstantsSize = kPushBytes;
    if (!aligns(key))
        return;
    limits.nonCoherentAtomSize = kMostAtom;
    limits.minStorageBufferOffsetAlignment = limits.minUniformBufferOffsetAlignment =
        limits.minTexelBufferOffsetAlignment = kMostOffset;
    limits.bufferImageGranularity = 131072;
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties *properties)
{
    DRIVER_NEXT(vkGetPhysicalDeviceProperties)(handle, properties);
    setLimits(keyOf(handle), properties->limits);
}

VKAPI_ATTR void VKAPI_CALL getProperties2(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    DRIVER_NEXT(vkGetPhysicalDeviceProperties2)(handle, properties);
    setLimits(keyOf(handle), properties->properties.limits);
    if (!aligns(keyOf(handle)))
        return;
    if (auto *structures = inChainOut<VkPhysicalDeviceAccelerationStructurePropertiesKHR>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR))
        structures->minAccelerationStructureScratchOffsetAlignment = kScratchAlignment;
    if (auto *pipelines = inChainOut<VkPhysicalDeviceRayTracingPipelinePropertiesKHR>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR)) {
        pipelines->shaderGroupBaseAlignment = kTableAlignment;
        pipelines->shaderGroupHandleAlignment = kHandleAlignment;
        pipelines->maxShaderGroupStride = kMostStride;
    }
}

// --- scratch memory ---

void expectScratch(const char *command, uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos)
{
    for (const auto &info : std::span(infos, count)) {
        if (info.scratchData.deviceAddress % kScratchAlignment != 0)
            report(std::string(command) +
                   ": VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710: scratch memory at " +
                   std::to_string(info.scratchData.deviceAddress));
        if (info.geometryCount > 0 &&
            (info.pGeometries != nullptr ? info.pGeometries[0] : *info.ppGeometries[0]).geometryType ==
                VK_GEOMETRY_TYPE_INSTANCES_KHR) {
            const auto &instances =
                (info.pGeometries != nullptr ? info.pGeometries[0] : *info.ppGeometries[0]).geometry.instances;
            if (instances.data.deviceAddress % (instances.arrayOfPointers ? 8 : 16) != 0)
                report(std::string(command) + ": VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03715");
        }
    }
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    if (aligns(keyOf(handle)))
        expectScratch("vkCmdBuildAccelerationStructuresKHR", count, infos);
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    if (aligns(keyOf(handle)))
        expectScratch("vkCmdBuildAccelerationStructuresIndirectKHR", count, infos);
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresIndirectKHR)(handle, count, infos, addresses, strides, most);
}

// --- shader binding tables ---

void expectTable(void *key, const char *command, const char *which, const VkStridedDeviceAddressRegionKHR &region)
{
    if (!aligns(key))
        return;
    const std::string where = std::string(command) + ": " + which;
    if (region.deviceAddress % kTableAlignment != 0)
        report(where + " table at " + std::to_string(region.deviceAddress) +
               ", VUID-vkCmdTraceRaysKHR-pRayGenShaderBindingTable-03682 or its like");
    if (region.stride % kHandleAlignment != 0 || region.stride > kMostStride)
        report(where + " stride " + std::to_string(region.stride) +
               ", VUID-vkCmdTraceRaysKHR-stride-03686 or its like");
}

void expectTables(void *key, const char *command, const VkStridedDeviceAddressRegionKHR *raygen,
                  const VkStridedDeviceAddressRegionKHR *miss, const VkStridedDeviceAddressRegionKHR *hit,
                  const VkStridedDeviceAddressRegionKHR *callable)
{
    // The stride of the ray generation table is its size, and no multiple of anything.
    expectTable(key, command, "ray generation", {raygen->deviceAddress, 0, raygen->size});
    expectTable(key, command, "miss", *miss);
    expectTable(key, command, "hit", *hit);
    expectTable(key, command, "callable", *callable);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRays(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR *raygen,
                                        const VkStridedDeviceAddressRegionKHR *miss,
                                        const VkStridedDeviceAddressRegionKHR *hit,
                                        const VkStridedDeviceAddressRegionKHR *callable, uint32_t width,
                                        uint32_t height, uint32_t depth)
{
    expectTables(keyOf(handle), "vkCmdTraceRaysKHR", raygen, miss, hit, callable);
    DRIVER_NEXT(vkCmdTraceRaysKHR)(handle, raygen, miss, hit, callable, width, height, depth);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRaysIndirect(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR *raygen,
                                                const VkStridedDeviceAddressRegionKHR *miss,
                                                const VkStridedDeviceAddressRegionKHR *hit,
                                                const VkStridedDeviceAddressRegionKHR *callable,
                                                VkDeviceAddress command)
{
    expectTables(keyOf(handle), "vkCmdTraceRaysIndirectKHR", raygen, miss, hit, callable);
    DRIVER_NEXT(vkCmdTraceRaysIndirectKHR)(handle, raygen, miss, hit, callable, command);
}

// --- compute shaders ---

std::mutex modulesMutex;
std::map<VkShaderModule, uint32_t> invocationsOf; // of a workgroup, where a module's code says it

bool lacksQueries(void *key)
{
    return has(key, "noqueries");
}

bool declaresRayQueries(const uint32_t *code, size_t bytes)
{
    constexpr uint32_t kCapability = 17, kRayQueryKHR = 4472;
    const std::span words(code, bytes / sizeof(uint32_t));
    for (size_t at = 5; at < words.size() && (words[at] & 0xffff) == kCapability; at += words[at] >> 16)
        if (words[at + 1] == kRayQueryKHR)
            return true;
    return false;
}

// The most of all entry points.
uint32_t invocationsIn(const uint32_t *code, size_t bytes)
{
    constexpr uint32_t kExecutionMode = 16, kLocalSize = 17;
    const std::span words(code, bytes / sizeof(uint32_t));
    uint32_t most = 0;
    for (size_t at = 5; at < words.size() && words[at] >> 16 != 0; at += words[at] >> 16) {
        if ((words[at] & 0xffff) == kExecutionMode && words[at + 2] == kLocalSize)
            most = std::max(most, words[at + 3] * words[at + 4] * words[at + 5]);
    }
    return most;
}

VKAPI_ATTR VkResult VKAPI_CALL createShaderModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                                  const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    if (lacksQueries(keyOf(handle)) && declaresRayQueries(info->pCode, info->codeSize))
        report("vkCreateShaderModule: VUID-VkShaderModuleCreateInfo-pCode-08740: RayQueryKHR");
    const VkResult result = DRIVER_NEXT(vkCreateShaderModule)(handle, info, allocator, module);
    std::lock_guard lock(modulesMutex);
    if (result == VK_SUCCESS)
        invocationsOf[*module] = invocationsIn(info->pCode, info->codeSize);
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (const VkComputePipelineCreateInfo &info : std::span(infos, count)) {
        const auto *code =
            inChain<VkShaderModuleCreateInfo>(info.stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
        std::lock_guard lock(modulesMutex);
        const uint32_t invocations =
            code != nullptr ? invocationsIn(code->pCode, code->codeSize) : invocationsOf[info.stage.module];
        if (computesLittle(keyOf(handle)) && invocations > kInvocations)
            report("vkCreateComputePipelines: VUID-RuntimeSpirv-x-06432: a workgroup of " +
                   std::to_string(invocations));
    }
    return DRIVER_NEXT(vkCreateComputePipelines)(handle, cache, count, infos, allocator, pipelines);
}

VKAPI_ATTR void VKAPI_CALL cmdDispatch(VkCommandBuffer handle, uint32_t x, uint32_t y, uint32_t z)
{
    if (computesLittle(keyOf(handle)) && std::max({x, y, z}) > kGroups)
        report("VUID-vkCmdDispatch-groupCountX-00386 or its like: " + std::to_string(std::max({x, y, z})));
    DRIVER_NEXT(vkCmdDispatch)(handle, x, y, z);
}

// --- push constants ---

VKAPI_ATTR VkResult VKAPI_CALL createPipelineLayout(VkDevice handle, const VkPipelineLayoutCreateInfo *info,
                                                    const VkAllocationCallbacks *allocator, VkPipelineLayout *layout)
{
    for (const VkPushConstantRange &range : std::span(info->pPushConstantRanges, info->pushConstantRangeCount)) {
        if (pushesLittle(keyOf(handle)) && range.offset + range.size > kPushBytes)
            report("vkCreatePipelineLayout: VUID-VkPushConstantRange-size-00298: up to byte " +
                   std::to_string(range.offset + range.size));
    }
    return DRIVER_NEXT(vkCreatePipelineLayout)(handle, info, allocator, layout);
}

VKAPI_ATTR void VKAPI_CALL cmdPushConstants(VkCommandBuffer handle, VkPipelineLayout layout, VkShaderStageFlags stages,
                                            uint32_t offset, uint32_t size, const void *data)
{
    if (pushesLittle(keyOf(handle)) && offset + size > kPushBytes)
        report("VUID-vkCmdPushConstants-size-00371: up to byte " + std::to_string(offset + size));
    DRIVER_NEXT(vkCmdPushConstants)(handle, layout, stages, offset, size, data);
}

VKAPI_ATTR void VKAPI_CALL getFeatures2(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    auto *queries = inChainOut<VkPhysicalDeviceRayQueryFeaturesKHR>(
        features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR);
    if (queries != nullptr && lacksQueries(keyOf(handle)))
        queries->rayQuery = VK_FALSE;
    if (!has(keyOf(handle), "few"))
        return;
    if (auto *robustness = inChainOut<VkPhysicalDeviceRobustness2FeaturesEXT>(
            features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ROBUSTNESS_2_FEATURES_EXT))
        robustness->nullDescriptor = VK_FALSE;
    if (auto *indices = inChainOut<VkPhysicalDeviceIndexTypeUint8FeaturesEXT>(
            features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_INDEX_TYPE_UINT8_FEATURES_EXT))
        indices->indexTypeUint8 = VK_FALSE;
    if (auto *vulkan12 = inChainOut<VkPhysicalDeviceVulkan12Features>(
            features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES))
        vulkan12->drawIndirectCount = VK_FALSE;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [&](std::vector<VkExtensionProperties> &all) {
        if (lacksQueries(keyOf(handle)))
            std::erase_if(all, [](const VkExtensionProperties &e) {
                return std::strcmp(e.extensionName, VK_KHR_RAY_QUERY_EXTENSION_NAME) == 0;
            });
    });
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    for (const char *name : std::span(info->ppEnabledExtensionNames, info->enabledExtensionCount))
        if (lacksQueries(keyOf(handle)) && std::strcmp(name, VK_KHR_RAY_QUERY_EXTENSION_NAME) == 0)
            return VK_ERROR_EXTENSION_NOT_PRESENT;
    return DRIVER_NEXT(vkCreateDevice)(handle, info, allocator, device);
}

} // namespace

driver::LevelRows driver::limitRows()
{
    static const Row device[]{
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(cmdBuildIndirect)},
        {"vkCmdTraceRaysKHR", DRIVER_FUNCTION(cmdTraceRays)},
        {"vkCmdTraceRaysIndirectKHR", DRIVER_FUNCTION(cmdTraceRaysIndirect)},
        {"vkCreatePipelineLayout", DRIVER_FUNCTION(createPipelineLayout)},
        {"vkCmdPushConstants", DRIVER_FUNCTION(cmdPushConstants)},
        {"vkCreateShaderModule", DRIVER_FUNCTION(createShaderModule)},
        {"vkCreateComputePipelines", DRIVER_FUNCTION(createComputePipelines)},
        {"vkCmdDispatch", DRIVER_FUNCTION(cmdDispatch)},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceProperties", DRIVER_FUNCTION(getProperties)},
        {"vkGetPhysicalDeviceProperties2", DRIVER_FUNCTION(getProperties2)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures2)},
    };
    return {device, instance};
}
