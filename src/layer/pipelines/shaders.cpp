// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/shaders.h"

#include <cstring>
#include <memory>
#include <string>

#include "layer/base/commands.h"
#include "layer/base/driver.h"
#include "layer/base/undo.h"
#include "layer/input/checked.h"
#include "layer/pipelines/binaries.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/rules/creations.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{

VkFlags64 unknownPipelineFlags(const Driver &driver)
{
    if (driver.emulated())
        return kMicromapPipelineFlags;
    if (!driver.translated())
        return 0;
    return VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR |
           (driver.enabled.pipelineMicromaps ? 0 : VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM);
}

bool changePipelineFlags(const Driver &driver, const void *&pNext, VkPipelineCreateFlags &flags, VkFlags64 removed,
                         VkFlags64 added, std::deque<Chain> &chains, const char *command)
{
    // Also if VkPipelineCreateFlags2CreateInfo replaces them: a driver may reject unknown flags nevertheless.
    flags = static_cast<VkPipelineCreateFlags>((flags & ~removed) | added);
    const auto *flags2 = findInChain<VkPipelineCreateFlags2CreateInfoKHR>(
        pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    if (!flags2 || flags2->flags == ((flags2->flags & ~removed) | added))
        return true;
    Chain &chain = chains.emplace_back(pNext);
    auto *own =
        chain.edit<VkPipelineCreateFlags2CreateInfoKHR>(VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    if (!own) {
        driver.report().error("VELLUM-pipeline-flags",
                              std::string(command) + ": VkPipelineCreateFlags2CreateInfo, whose flags the driver must "
                                                     "not get as they are, is behind a structure of unknown size");
        return false;
    }
    own->flags = (own->flags & ~removed) | added;
    pNext = chain.head();
    return true;
}

namespace
{

// Creates compute or graphics pipelines by the driver's command. Pipelines with module identifiers are created one by
// one, since the driver may have to be called several times for each (DriverIdentifiers::useUntilKnown).
template <typename Info, typename Command>
VkResult createPipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                         const Info *infos, const VkAllocationCallbacks *allocator, VkPipeline *pipelines,
                         Command command)
{
    const auto checked = input::Checked<input::Pipelines>::take(
        infos, [&] { return rules::checkPipelines(device.objects.rules, count, infos); });
    std::deque<DriverPipelineInfo> driverInfos;
    std::vector<Info> own(infos, infos + count);
    const std::vector<VkResult> prepared = prepareEach(std::span(own), [&](Info &info) {
        DriverPipelineInfo &driverInfo = driverInfos.emplace_back(device);
        return checked.accepted[static_cast<size_t>(&info - own.data())] ? driverInfo.change(info)
                                                                         : VK_ERROR_VALIDATION_FAILED_EXT;
    });
    const auto hasIdentifiers = [](const DriverPipelineInfo &info) { return info.identifiers.any(); };
    if (allSucceeded(prepared) && std::ranges::none_of(driverInfos, hasIdentifiers))
        return command(handle, cache, count, own.data(), allocator, pipelines);
    return createEach(std::span(own), pipelines, [&](size_t i, const Info &info, VkPipeline &pipeline) {
        return prepared[i] != VK_SUCCESS ? prepared[i] : driverInfos[i].identifiers.useUntilKnown([&] {
            return command(handle, cache, 1, &info, allocator, &pipeline);
        });
    });
}

} // namespace

VkResult createShaderModule(DevicePipelines &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    SharedWords storage;
    const std::span<const uint32_t> words(info->pCode, info->codeSize / 4);
    const spirv::ModuleScan scan = spirv::scan(words);
    if ((scan.tracesRays || device.driver.translated()) &&
        !rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage))
        return VK_ERROR_INVALID_SHADER_NV;
    std::shared_ptr<const RayTracingModule> original;
    if (device.driver.providesMicromaps() && scan.hasStages) {
        const auto code =
            input::Checked<input::OriginalCode>::take(info->pCode, [] { return input::OriginalCode{}; }).words;
        original = std::make_shared<RayTracingModule>(RayTracingModule{
            {words.begin(), words.end()}, scan.traced, code.empty() ? 0 : ShaderWarnings::hashOf(code)});
    }
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

template <typename Info>
VkResult DriverPipelineInfo::change(Info &info, const VkPipelineShaderStageCreateInfo *&stages, uint32_t count,
                                    const char *command)
{
    const Driver &driver = device_.driver;
    if (!changePipelineFlags(driver, info.pNext, info.flags, unknownPipelineFlags(driver), 0, chains_, command))
        return VK_ERROR_INITIALIZATION_FAILED;
    if (binariesOf(info.pNext))
        return VK_SUCCESS;
    if (!stages_.rewrite(stages, count))
        return VK_ERROR_INVALID_SHADER_NV;
    identifiers.replace(stages, count);
    return VK_SUCCESS;
}

VkResult DriverPipelineInfo::change(VkComputePipelineCreateInfo &info)
{
    const VkPipelineShaderStageCreateInfo *stage = &info.stage;
    const VkResult result = change(info, stage, 1, "vkCreateComputePipelines");
    if (stage != &info.stage)
        info.stage = *stage;
    return result;
}

VkResult DriverPipelineInfo::change(VkGraphicsPipelineCreateInfo &info)
{
    const uint32_t count = hasShaderStages(info) && info.pStages ? info.stageCount : 0;
    const VkResult result = change(info, info.pStages, count, "vkCreateGraphicsPipelines");
    return result == VK_SUCCESS && !binariesOf(info.pNext) ? changeGroups(info) : result;
}

// The shader groups of VK_NV_device_generated_commands have stages of their own.
VkResult DriverPipelineInfo::changeGroups(VkGraphicsPipelineCreateInfo &info)
{
    constexpr VkStructureType type = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_SHADER_GROUPS_CREATE_INFO_NV;
    const auto *application = findInChain<VkGraphicsPipelineShaderGroupsCreateInfoNV>(info.pNext, type);
    if (!application)
        return VK_SUCCESS;
    groups_.assign(application->pGroups, application->pGroups + application->groupCount);
    bool changed = false;
    for (VkGraphicsShaderGroupCreateInfoNV &group : groups_) {
        const VkPipelineShaderStageCreateInfo *stages = group.pStages;
        if (!stages_.rewrite(group.pStages, group.stageCount))
            return VK_ERROR_INVALID_SHADER_NV;
        changed = changed || group.pStages != stages;
    }
    if (!changed)
        return VK_SUCCESS;
    Chain &chain = chains_.emplace_back(info.pNext);
    auto *own = chain.edit<VkGraphicsPipelineShaderGroupsCreateInfoNV>(type);
    if (!own) {
        device_.driver.report().error("VELLUM-shader-rewrite", "shader groups are behind a structure of unknown size");
        return VK_ERROR_INVALID_SHADER_NV;
    }
    own->pGroups = groups_.data();
    info.pNext = chain.head();
    return VK_SUCCESS;
}

VkResult createComputePipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                const VkComputePipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                VkPipeline *pipelines)
{
    return createPipelines(device, handle, cache, count, infos, allocator, pipelines,
                           device.driver.next.CreateComputePipelines);
}

// VK_NV_device_generated_commands_compute: the memory for a pipeline of the driver's code. If that cannot be made, the
// pipeline cannot be created either.
void getPipelineIndirectMemoryRequirements(DevicePipelines &device, VkDevice handle,
                                           const VkComputePipelineCreateInfo *info, VkMemoryRequirements2 *requirements)
{
    VkComputePipelineCreateInfo own = *info;
    DriverPipelineInfo driverInfo(device);
    driverInfo.change(own);
    device.driver.next.GetPipelineIndirectMemoryRequirementsNV(handle, &own, requirements);
}

VkResult createGraphicsPipelines(DevicePipelines &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                 const VkGraphicsPipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                 VkPipeline *pipelines)
{
    return createPipelines(device, handle, cache, count, infos, allocator, pipelines,
                           device.driver.next.CreateGraphicsPipelines);
}

VkResult createShaders(DevicePipelines &device, VkDevice handle, uint32_t count, const VkShaderCreateInfoEXT *infos,
                       const VkAllocationCallbacks *allocator, VkShaderEXT *shaders)
{
    constexpr auto kPromise =
        static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);
    const auto checked = input::Checked<input::Pipelines>::take(
        infos, [&] { return rules::checkShaders(device.objects.rules, count, infos); });
    std::vector<VkShaderCreateInfoEXT> own(infos, infos + count);
    std::deque<SharedWords> storage;
    const auto prepare = [&](VkShaderCreateInfoEXT &info) {
        if (device.driver.providesMicromaps()) {
            info.flags &= ~kPromise; // the driver does not know it
            if (!checked.accepted[static_cast<size_t>(&info - own.data())])
                return VK_ERROR_VALIDATION_FAILED_EXT;
        }
        if (info.codeType == VK_SHADER_CODE_TYPE_BINARY_EXT && !device.driver.emulated())
            return VK_SUCCESS;
        if (info.codeType == VK_SHADER_CODE_TYPE_BINARY_EXT) {
            const ShaderBinaryHeader header = shaderBinaryHeader(device);
            if (info.codeSize < sizeof header || std::memcmp(info.pCode, &header, sizeof header) != 0)
                return VK_INCOMPATIBLE_SHADER_BINARY_EXT;
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
    // The result is that of the first null object, so only those before one that fails here are created.
    std::fill_n(shaders, count, nullptr);
    VkResult failure = VK_SUCCESS;
    uint32_t prepared = 0;
    while (prepared < count && failure == VK_SUCCESS) {
        failure = prepare(own[prepared]);
        prepared += failure == VK_SUCCESS ? 1 : 0;
    }
    const VkResult result = prepared > 0
                                ? device.driver.next.CreateShadersEXT(handle, prepared, own.data(), allocator, shaders)
                                : VK_SUCCESS;
    return result == VK_SUCCESS ? failure : result;
}

} // namespace vellum::layer
