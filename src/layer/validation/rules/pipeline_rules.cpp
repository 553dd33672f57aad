// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/pipeline_rules.h"

#include <algorithm>
#include <span>

#include "core/opacity.h"
#include "layer/base/pipeline_info.h"
#include "layer/rules/creations.h"
#include "layer/validation/model/device_model.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kMicromapFlags = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
constexpr VkFlags64 kNoMicromaps = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM;

std::vector<spirv::EntryPoint> entryPointsOf(std::span<const uint32_t> words)
{
    std::string error;
    auto entryPoints = spirv::readEntryPoints(words, error).value_or(std::vector<spirv::EntryPoint>{});
    std::erase_if(entryPoints,
                  [](const spirv::EntryPoint &entry) { return entry.mode.when == spirv::MicromapMode::When::Absent; });
    return entryPoints;
}

void checkWords(DeviceModel &device, const Place &place, std::span<const uint32_t> words)
{
    if (spirv::forcesTwoStatesWithoutCapability(words))
        device.at(place).report("VUID-RuntimeSpirv-RayTracingOpacityMicromapKHR-11542", "pCode",
                                "ray flags with ForceOpacityMicromap2StateKHR; the module lacks the capability "
                                "RayTracingOpacityMicromapKHR");
}

std::span<const uint32_t> wordsOf(const VkShaderModuleCreateInfo &info)
{
    return {info.pCode, info.codeSize / sizeof(uint32_t)};
}

void checkStage(DeviceModel &device, const Place &place, const VkPipelineShaderStageCreateInfo &stage, VkFlags64 flags)
{
    auto entryPoints = device.objects.pipelines.modules.get(stage.module);
    const auto *module =
        findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (!stage.module && module) {
        checkWords(device, place, wordsOf(*module));
        entryPoints = std::make_shared<const std::vector<spirv::EntryPoint>>(entryPointsOf(wordsOf(*module)));
    }
    if (!entryPoints || (flags & kNoMicromaps) == 0)
        return;
    for (const spirv::EntryPoint &entry : *entryPoints) {
        if (entry.name == stage.pName && entry.model == executionModelOf(stage.stage) &&
            valueOf(entry.mode, stage.pSpecializationInfo).value_or(false))
            device.at(place).report(
                "VUID-RuntimeSpirv-micromap-11630", nullptr,
                "entry point " + entry.name +
                    " has the execution mode OpacityMicromapIdKHR; the pipeline has DISALLOW_OPACITY_MICROMAP");
    }
}

// The flag of a pipeline that rays of ray tracing pipelines do not meet.
void checkFlags(DeviceModel &device, const Place &place, VkFlags64 flags, const char *micromapRule)
{
    if ((flags & kMicromapFlags) != 0)
        device.at(place).report(micromapRule, "flags",
                                "RAY_TRACING_OPACITY_MICROMAP, which is for ray tracing pipelines only");
}

} // namespace

input::Pipelines checkPipelines(DeviceModel &device, uint32_t count, const VkComputePipelineCreateInfo *infos)
{
    const Place command("vkCreateComputePipelines");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        checkFlags(device, place, flags, "VUID-VkComputePipelineCreateInfo-flags-07367");
        checkStage(device, place.member("stage"), infos[i].stage, flags);
    }
    return rules::checkPipelines(device.rules, count, infos);
}

input::Pipelines checkPipelines(DeviceModel &device, uint32_t count, const VkGraphicsPipelineCreateInfo *infos)
{
    const Place command("vkCreateGraphicsPipelines");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        checkFlags(device, place, flags, "VUID-VkGraphicsPipelineCreateInfo-flags-07401");
        const bool hasStages = infos[i].pStages && hasShaderStages(infos[i]);
        for (uint32_t s = 0; hasStages && s < infos[i].stageCount; ++s)
            checkStage(device, place.element("pStages", s), infos[i].pStages[s], flags);
    }
    return rules::checkPipelines(device.rules, count, infos);
}

input::Pipelines checkPipelines(DeviceModel &device, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos)
{
    const Place command("vkCreateRayTracingPipelinesKHR");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        if ((flags & kMicromapFlags) != 0 && (flags & kNoMicromaps) != 0)
            device.at(place).report("VUID-VkRayTracingPipelineCreateInfoKHR-flags-10392", "flags",
                                    "both RAY_TRACING_OPACITY_MICROMAP and DISALLOW_OPACITY_MICROMAP");
        for (uint32_t s = 0; s < infos[i].stageCount; ++s)
            checkStage(device, place.element("pStages", s), infos[i].pStages[s], flags);
    }
    return rules::checkPipelines(device.rules, count, infos, [&](VkPipeline handle) {
        const auto library = device.objects.pipelines.libraries.get(handle);
        return library ? std::optional((*library & kMicromapFlags) != 0) : std::nullopt;
    });
}

input::Pipelines checkShaders(DeviceModel &device, uint32_t count, const VkShaderCreateInfoEXT *infos)
{
    const Place command("vkCreateShadersEXT");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        if (infos[i].codeType == VK_SHADER_CODE_TYPE_SPIRV_EXT)
            checkWords(device, place,
                       {static_cast<const uint32_t *>(infos[i].pCode), infos[i].codeSize / sizeof(uint32_t)});
    }
    return rules::checkShaders(device.rules, count, infos);
}

void checkModule(DeviceModel &device, const VkShaderModuleCreateInfo &info)
{
    const Place command("vkCreateShaderModule");
    if (device.checks.core)
        checkWords(device, command.member("pCreateInfo"), wordsOf(info));
}

void keepModule(DeviceModel &device, const VkShaderModuleCreateInfo &info, VkShaderModule module)
{
    if (auto entryPoints = entryPointsOf(wordsOf(info)); !entryPoints.empty())
        device.objects.pipelines.modules.set(
            module, std::make_shared<const std::vector<spirv::EntryPoint>>(std::move(entryPoints)));
}

void keepLibraries(DeviceModel &device, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos,
                   const VkPipeline *pipelines)
{
    for (uint32_t i = 0; i < count; ++i) {
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        if (pipelines[i] && (flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) != 0)
            device.objects.pipelines.libraries.set(pipelines[i], flags);
    }
}

} // namespace vellum::layer
