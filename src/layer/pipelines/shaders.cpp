#include "layer/pipelines/shaders.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "layer/ground/pnext.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/pipeline_flags.h"
#include "layer/pipelines/shader_binary.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags kDisallowMixedShader =
    static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);

VkResult failAll(uint32_t count, VkPipeline *pipelines, VkResult result = VK_ERROR_INVALID_SHADER_NV)
{
    for (uint32_t i = 0; i < count; ++i)
        pipelines[i] = VK_NULL_HANDLE;
    return result;
}

} // namespace

VkResult createShaderModule(DevicePipelines &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    if (!rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage))
        return VK_ERROR_INVALID_SHADER_NV;
    const std::span<const uint32_t> words(info->pCode, info->codeSize / 4);
    std::shared_ptr<const std::vector<uint32_t>> original;
    if (spirv::hasRayTracingStages(words))
        original = std::make_shared<std::vector<uint32_t>>(words.begin(), words.end());
    const VkResult result = device.driver.next.CreateShaderModule(handle, &driverInfo, allocator, module);
    if (result == VK_SUCCESS && original)
        device.rayTracingModules.set(*module, std::move(original));
    return result;
}

void destroyShaderModule(DevicePipelines &device, VkDevice handle, VkShaderModule module,
                         const VkAllocationCallbacks *allocator)
{
    device.rayTracingModules.take(module);
    device.driver.next.DestroyShaderModule(handle, module, allocator);
}

VkResult createComputePipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                const VkComputePipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                VkPipeline *pipelines)
{
    DriverStages stages(device);
    std::deque<Chain> chains;
    std::vector<VkComputePipelineCreateInfo> own(infos, infos + count);
    for (VkComputePipelineCreateInfo &info : own) {
        if (!mayHaveFlags(device.driver, info.pNext, info.flags, "VELLUM-VUID-VkComputePipelineCreateInfo-flags-11593",
                          "vkCreateComputePipelines"))
            return failAll(count, pipelines, VK_ERROR_VALIDATION_FAILED_EXT);
        info.pNext = driverChain(info.pNext, chains);
        const VkPipelineShaderStageCreateInfo *stage = &info.stage;
        if (!stages.rewrite(stage, 1))
            return failAll(count, pipelines);
        if (stage != &info.stage)
            info.stage = *stage;
    }
    return device.driver.next.CreateComputePipelines(handle, cache, count, own.data(), allocator, pipelines);
}

VkResult createGraphicsPipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                 const VkGraphicsPipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                 VkPipeline *pipelines)
{
    DriverStages stages(device);
    std::deque<Chain> chains;
    std::vector<VkGraphicsPipelineCreateInfo> own(infos, infos + count);
    for (VkGraphicsPipelineCreateInfo &info : own) {
        if (!mayHaveFlags(device.driver, info.pNext, info.flags, "VELLUM-VUID-VkGraphicsPipelineCreateInfo-flags-11595",
                          "vkCreateGraphicsPipelines"))
            return failAll(count, pipelines, VK_ERROR_VALIDATION_FAILED_EXT);
        info.pNext = driverChain(info.pNext, chains);
        if (hasShaderStages(info) && !stages.rewrite(info.pStages, info.stageCount))
            return failAll(count, pipelines);
    }
    return device.driver.next.CreateGraphicsPipelines(handle, cache, count, own.data(), allocator, pipelines);
}

VkResult createShaders(DevicePipelines &device, VkDevice handle, uint32_t count, const newer::ShaderCreateInfo *infos,
                       const VkAllocationCallbacks *allocator, newer::ShaderEXT *shaders)
{
    std::vector<newer::ShaderCreateInfo> own(infos, infos + count);
    std::deque<std::vector<uint32_t>> storage;
    for (newer::ShaderCreateInfo &info : own) {
        if ((info.flags & kDisallowMixedShader) != 0 && !device.driver.asked.khrFeature &&
            !toleratesMixedSpecialIndex(device.driver, "VELLUM-VUID-VkShaderCreateInfoEXT-micromap-11623",
                                        "vkCreateShadersEXT")) {
            std::fill_n(shaders, count, nullptr);
            return VK_ERROR_VALIDATION_FAILED_EXT;
        }
        info.flags &= ~kDisallowMixedShader;
        if (info.codeType == newer::kShaderCodeTypeBinary) {
            const ShaderBinaryHeader header = shaderBinaryHeader(device);
            if (info.codeSize < sizeof header || std::memcmp(info.pCode, &header, sizeof header) != 0) {
                std::fill_n(shaders, count, nullptr);
                return newer::kIncompatibleShaderBinary;
            }
            info.pCode = static_cast<const std::byte *>(info.pCode) + sizeof header;
            info.codeSize -= sizeof header;
            continue;
        }
        const auto *code = static_cast<const uint32_t *>(info.pCode);
        if (!rewriteShader(device, code, info.codeSize, storage.emplace_back())) {
            std::fill_n(shaders, count, nullptr);
            return VK_ERROR_INITIALIZATION_FAILED; // of the errors of vkCreateShadersEXT the one about the code
        }
        info.pCode = code;
    }
    return device.driver.next.CreateShadersEXT(handle, count, own.data(), allocator, shaders);
}

} // namespace vellum::layer
