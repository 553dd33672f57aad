#include "layer/pipelines/shaders.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "layer/base/pnext.h"
#include "layer/base/undo.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/pipeline_binaries.h"
#include "layer/pipelines/pipeline_flags.h"
#include "layer/pipelines/shader_binary.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{
namespace
{

// Compute or graphics pipelines, by the driver's command. Those with stages that are known by their identifiers only
// are made one by one, in every way to read these until the driver knows one.
template <typename Info, typename Command>
VkResult createPipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                         const Info *infos, const VkAllocationCallbacks *allocator, VkPipeline *pipelines,
                         Command command)
{
    DriverStages stages(device);
    std::deque<DriverIdentifiers> identifiers;
    std::deque<Chain> chains;
    std::vector<Info> own(infos, infos + count);
    const std::vector<VkResult> prepared = prepareEach(std::span(own), [&](Info &info) {
        return translate(device, info, stages, identifiers.emplace_back(device), chains);
    });
    if (allSucceeded(prepared) && std::ranges::none_of(identifiers, &DriverIdentifiers::any))
        return command(handle, cache, count, own.data(), allocator, pipelines);
    return createEach(std::span(own), pipelines, [&](size_t i, const Info &info, VkPipeline &pipeline) {
        return prepared[i] != VK_SUCCESS ? prepared[i] : identifiers[i].useUntilKnown([&] {
            return command(handle, cache, 1, &info, allocator, &pipeline);
        });
    });
}

} // namespace

VkResult createShaderModule(DevicePipelines &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    const bool emulated = device.driver.emulated();
    const std::span<const uint32_t> words(info->pCode, info->codeSize / 4);
    const spirv::ModuleScan scan = spirv::scan(words);
    if (emulated && scan.tracesRays && !rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage))
        return VK_ERROR_INVALID_SHADER_NV;
    std::shared_ptr<const RayTracingModule> original;
    if (emulated && scan.hasStages)
        original = std::make_shared<RayTracingModule>(RayTracingModule{{words.begin(), words.end()}, scan.traced});
    const VkResult result = device.driver.next.CreateShaderModule(handle, &driverInfo, allocator, module);
    if (result != VK_SUCCESS)
        return result;
    Undo undo([&] { destroyShaderModule(device, handle, *module, allocator); });
    if (original)
        device.rayTracingModules.set(*module, std::move(original));
    if (scan.tracesRays)
        device.tracingModules.set(*module, true);
    undo.keep();
    return result;
}

void destroyShaderModule(DevicePipelines &device, VkDevice handle, VkShaderModule module,
                         const VkAllocationCallbacks *allocator)
{
    device.rayTracingModules.take(module);
    device.tracingModules.take(module);
    device.driver.next.DestroyShaderModule(handle, module, allocator);
}

VkResult translate(DevicePipelines &device, VkComputePipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains)
{
    const bool emulated = device.driver.emulated();
    if (emulated && !mayHaveFlags(device.driver, info.pNext, info.flags,
                                  "VELLUM-VUID-VkComputePipelineCreateInfo-flags-11593", "vkCreateComputePipelines"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (emulated && !hideMicromapFlags(device.driver, info.pNext, chains, "vkCreateComputePipelines"))
        return VK_ERROR_INITIALIZATION_FAILED;
    if (binariesOf(info.pNext))
        return VK_SUCCESS;
    const VkPipelineShaderStageCreateInfo *stage = &info.stage;
    if (emulated && !stages.rewrite(stage, 1))
        return VK_ERROR_INVALID_SHADER_NV;
    identifiers.take(stage, 1);
    if (stage != &info.stage)
        info.stage = *stage;
    return VK_SUCCESS;
}

VkResult translate(DevicePipelines &device, VkGraphicsPipelineCreateInfo &info, DriverStages &stages,
                   DriverIdentifiers &identifiers, std::deque<Chain> &chains)
{
    const bool emulated = device.driver.emulated();
    if (emulated && !mayHaveFlags(device.driver, info.pNext, info.flags,
                                  "VELLUM-VUID-VkGraphicsPipelineCreateInfo-flags-11595", "vkCreateGraphicsPipelines"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (emulated && !hideMicromapFlags(device.driver, info.pNext, chains, "vkCreateGraphicsPipelines"))
        return VK_ERROR_INITIALIZATION_FAILED;
    if (!hasShaderStages(info) || binariesOf(info.pNext))
        return VK_SUCCESS;
    if (emulated && !stages.rewrite(info.pStages, info.stageCount))
        return VK_ERROR_INVALID_SHADER_NV;
    identifiers.take(info.pStages, info.pStages ? info.stageCount : 0);
    return VK_SUCCESS;
}

VkResult createComputePipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                const VkComputePipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                VkPipeline *pipelines)
{
    return createPipelines(device, handle, cache, count, infos, allocator, pipelines,
                           device.driver.next.CreateComputePipelines);
}

VkResult createGraphicsPipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                 const VkGraphicsPipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                 VkPipeline *pipelines)
{
    return createPipelines(device, handle, cache, count, infos, allocator, pipelines,
                           device.driver.next.CreateGraphicsPipelines);
}

VkResult createShaders(DevicePipelines &device, VkDevice handle, uint32_t count, const newer::ShaderCreateInfo *infos,
                       const VkAllocationCallbacks *allocator, newer::ShaderEXT *shaders)
{
    std::vector<newer::ShaderCreateInfo> own(infos, infos + count);
    std::deque<std::vector<uint32_t>> storage;
    const auto prepare = [&](newer::ShaderCreateInfo &info) {
        if (!takeMixedSpecialIndex(device.driver, info))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        if (info.codeType == newer::kShaderCodeTypeBinary) {
            const ShaderBinaryHeader header = shaderBinaryHeader(device);
            if (info.codeSize < sizeof header || std::memcmp(info.pCode, &header, sizeof header) != 0)
                return newer::kIncompatibleShaderBinary;
            info.pCode = static_cast<const std::byte *>(info.pCode) + sizeof header;
            info.codeSize -= sizeof header;
            return VK_SUCCESS;
        }
        const auto *code = static_cast<const uint32_t *>(info.pCode);
        if (!rewriteShader(device, code, info.codeSize, storage.emplace_back()))
            return VK_ERROR_INITIALIZATION_FAILED; // of the errors of vkCreateShadersEXT the one about the code
        info.pCode = code;
        return VK_SUCCESS;
    };
    return createShadersBeforeFailure(own, shaders, prepare, [&](uint32_t prepared) {
        return device.driver.next.CreateShadersEXT(handle, prepared, own.data(), allocator, shaders);
    });
}

} // namespace vellum::layer
