// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/pipeline_rules.h"

#include <algorithm>
#include <span>

#include "core/opacity.h"
#include "layer/base/pipeline_info.h"
#include "layer/rules/ids.h"
#include "layer/validation/model/device_model.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kMicromapFlags = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
constexpr VkFlags64 kNoMicromaps = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM;
constexpr VkFlags64 kNotMixed = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;
constexpr auto kShaderNotMixed =
    static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);

template <typename Info>
VkFlags64 flagsOf(const Info &info)
{
    const auto *flags2 = findInChain<VkPipelineCreateFlags2CreateInfoKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    return flags2 ? flags2->flags : info.flags;
}

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
        device.fault(place.member("pCode"), "VUID-RuntimeSpirv-RayTracingOpacityMicromapKHR-11542",
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
            device.fault(
                place, "VUID-RuntimeSpirv-micromap-11630",
                "entry point " + entry.name +
                    " has the execution mode OpacityMicromapIdKHR; the pipeline has DISALLOW_OPACITY_MICROMAP");
    }
}

// Flags of a pipeline that rays of ray tracing pipelines do not meet.
void checkFlags(DeviceModel &device, const Place &place, VkFlags64 flags, const char *micromapRule,
                const char *mixedRule)
{
    if ((flags & kMicromapFlags) != 0)
        device.fault(place.member("flags"), micromapRule,
                     "RAY_TRACING_OPACITY_MICROMAP, which is for ray tracing pipelines only");
    if ((flags & kNotMixed) != 0 && !device.driver.enabled.khrFeature)
        device.fault(place.member("flags"), mixedRule,
                     "OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX; micromap of "
                     "VkPhysicalDeviceOpacityMicromapFeaturesKHR is not enabled");
}

void checkRayTracingFlags(DeviceModel &device, const Place &place, const VkRayTracingPipelineCreateInfoKHR &info,
                          VkFlags64 flags)
{
    const bool micromaps = (flags & kMicromapFlags) != 0;
    const Place member = place.member("flags");
    const auto &enabled = device.driver.enabled;
    if (micromaps && (flags & kNoMicromaps) != 0)
        device.fault(member, "VUID-VkRayTracingPipelineCreateInfoKHR-flags-10392",
                     "both RAY_TRACING_OPACITY_MICROMAP and DISALLOW_OPACITY_MICROMAP");
    if (micromaps && !enabled.anyFeature())
        device.fault(member, rules::ids::kRayTracingFeature,
                     "RAY_TRACING_OPACITY_MICROMAP; the feature micromap is not enabled");
    if ((flags & kNotMixed) != 0 && (!micromaps || !enabled.khrFeature))
        device.fault(
            member, rules::ids::kRayTracingMixed,
            std::string("OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX, without ") +
                (micromaps ? "the feature micromap of VK_KHR_opacity_micromap" : "RAY_TRACING_OPACITY_MICROMAP"));
    for (uint32_t i = 0; micromaps && info.pLibraryInfo && i < info.pLibraryInfo->libraryCount; ++i) {
        const auto library = device.objects.pipelines.libraries.get(info.pLibraryInfo->pLibraries[i]);
        if (library && (*library & kMicromapFlags) == 0) {
            const Place libraries = place.member("pLibraryInfo");
            device.fault(
                libraries.element("pLibraries", i), rules::ids::kRayTracingLibraries,
                "the library was created without RAY_TRACING_OPACITY_MICROMAP; the pipeline has it",
                ObjectHandle(VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(info.pLibraryInfo->pLibraries[i])));
        }
    }
}

} // namespace

void checkPipelines(DeviceModel &device, uint32_t count, const VkComputePipelineCreateInfo *infos)
{
    const Place command("vkCreateComputePipelines");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = flagsOf(infos[i]);
        checkFlags(device, place, flags, "VUID-VkComputePipelineCreateInfo-flags-07367", rules::ids::kComputeMixed);
        checkStage(device, place.member("stage"), infos[i].stage, flags);
    }
}

void checkPipelines(DeviceModel &device, uint32_t count, const VkGraphicsPipelineCreateInfo *infos)
{
    const Place command("vkCreateGraphicsPipelines");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = flagsOf(infos[i]);
        checkFlags(device, place, flags, "VUID-VkGraphicsPipelineCreateInfo-flags-07401", rules::ids::kGraphicsMixed);
        // A library without shaders ignores pStages, which may be invalid.
        const auto *library = findInChain<VkGraphicsPipelineLibraryCreateInfoEXT>(
            infos[i].pNext, VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_LIBRARY_CREATE_INFO_EXT);
        constexpr VkGraphicsPipelineLibraryFlagsEXT kWithShaders =
            VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT |
            VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT;
        const bool hasStages = infos[i].pStages && (!library || (library->flags & kWithShaders) != 0);
        for (uint32_t s = 0; hasStages && s < infos[i].stageCount; ++s)
            checkStage(device, place.element("pStages", s), infos[i].pStages[s], flags);
    }
}

void checkPipelines(DeviceModel &device, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos)
{
    const Place command("vkCreateRayTracingPipelinesKHR");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = flagsOf(infos[i]);
        checkRayTracingFlags(device, place, infos[i], flags);
        for (uint32_t s = 0; s < infos[i].stageCount; ++s)
            checkStage(device, place.element("pStages", s), infos[i].pStages[s], flags);
    }
}

void checkShaders(DeviceModel &device, uint32_t count, const VkShaderCreateInfoEXT *infos)
{
    const Place command("vkCreateShadersEXT");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        if ((infos[i].flags & kShaderNotMixed) != 0 && !device.driver.enabled.khrFeature)
            device.fault(place.member("flags"), rules::ids::kShaderMixed,
                         "OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX; micromap of "
                         "VkPhysicalDeviceOpacityMicromapFeaturesKHR is not enabled");
        if (infos[i].codeType == VK_SHADER_CODE_TYPE_SPIRV_EXT)
            checkWords(device, place,
                       {static_cast<const uint32_t *>(infos[i].pCode), infos[i].codeSize / sizeof(uint32_t)});
    }
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
        const VkFlags64 flags = flagsOf(infos[i]);
        if (pipelines[i] && (flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) != 0)
            device.objects.pipelines.libraries.set(pipelines[i], flags);
    }
}

} // namespace vellum::layer
