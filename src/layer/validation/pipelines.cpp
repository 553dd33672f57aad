// SPDX-License-Identifier: Apache-2.0
// Shader modules, pipelines, shader objects, and commands that run generated commands.
#include "layer/base/pipeline_info.h"
#include "layer/base/pnext.h"
#include "layer/input/checked.h"
#include "layer/rules/creations.h"
#include "layer/validation/commands.h"
#include "layer/validation/traces/traced_code.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/scan.h"

namespace vellum::layer::validation
{
namespace
{

constexpr VkFlags64 kMixedPromise = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;
constexpr VkShaderStageFlags kRayTracingStages =
    VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
    VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;

constexpr VkFlags64 kMicromapFlags = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
constexpr VkFlags64 kNoMicromaps = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM;

// Those with the execution mode OpacityMicromapIdKHR.
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
    const auto known = device.objects.modules.get(stage.module);
    const auto *inlined =
        stage.module ? nullptr
                     : findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (inlined)
        checkWords(device, place, wordsOf(*inlined));
    if ((!known && !inlined) || (flags & kNoMicromaps) == 0)
        return;
    for (const spirv::EntryPoint &entry : entryPointsOf(known ? std::span(*known) : wordsOf(*inlined))) {
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

input::Pipelines checkPipelines(DeviceValidation &device, uint32_t count, const VkComputePipelineCreateInfo *infos)
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

// Each library of a graphics pipeline that makes the promise must make it.
void checkLibraries(DeviceValidation &device, const Place &place, const VkGraphicsPipelineCreateInfo &info)
{
    const auto *libraries =
        findInChain<VkPipelineLibraryCreateInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_LIBRARY_CREATE_INFO_KHR);
    if (!libraries || (pipelineFlags(info.pNext, info.flags) & kMixedPromise) == 0)
        return;
    for (uint32_t i = 0; i < libraries->libraryCount; ++i) {
        const VkPipeline library = libraries->pLibraries[i];
        if (const auto flags = device.objects.libraries.get(library); flags && (*flags & kMixedPromise) == 0)
            device.at(place.element("pLibraries", i), {VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(library)})
                .report("VUID-VkGraphicsPipelineCreateInfo-pLibraries-11594", nullptr,
                        "the library was created without OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX, which the "
                        "pipeline has");
    }
}

input::Pipelines checkPipelines(DeviceValidation &device, uint32_t count, const VkGraphicsPipelineCreateInfo *infos)
{
    const Place command("vkCreateGraphicsPipelines");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        checkFlags(device, place, flags, "VUID-VkGraphicsPipelineCreateInfo-flags-07401");
        checkLibraries(device, place, infos[i]);
        const bool hasStages = infos[i].pStages && hasShaderStages(infos[i]);
        for (uint32_t s = 0; hasStages && s < infos[i].stageCount; ++s)
            checkStage(device, place.element("pStages", s), infos[i].pStages[s], flags);
    }
    return rules::checkPipelines(device.rules, count, infos);
}

input::Pipelines checkPipelines(DeviceValidation &device, uint32_t count,
                                const VkRayTracingPipelineCreateInfoKHR *infos)
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
        const auto library = device.objects.libraries.get(handle);
        return library ? std::optional((*library & kMicromapFlags) != 0) : std::nullopt;
    });
}

input::Pipelines checkShaders(DeviceValidation &device, uint32_t count, const VkShaderCreateInfoEXT *infos)
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

// Keeps the flags of libraries.
template <typename Info>
void keepLibraries(DeviceValidation &device, uint32_t count, const Info *infos, const VkPipeline *pipelines)
{
    for (uint32_t i = 0; i < count; ++i) {
        const VkFlags64 flags = pipelineFlags(infos[i].pNext, infos[i].flags);
        if (pipelines[i] && (flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) != 0)
            remember(device.objects, [&] { device.objects.libraries.set(pipelines[i], flags); });
    }
}

// Creates pipelines by `create(infos)`. `checked`: by the rules.
template <typename Info, typename Create>
VkResult createPipelines(DeviceValidation &device, uint32_t count, const Info *infos, VkPipeline *pipelines,
                         input::Pipelines checked, Create create)
{
    std::vector<Info> own(infos, infos + count);
    MarkedPipelines marked(device.traces);
    for (Info &info : own)
        marked.change(info);
    marked.prepare();
    const input::Checked handed(own.data(), checked);
    const VkResult result = create(own.data());
    marked.set(count, pipelines);
    keepLibraries(device, count, infos, pipelines);
    return result;
}

} // namespace

VkResult createShaderModule(DeviceValidation &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    const std::span<const uint32_t> words = wordsOf(*info);
    const Place command("vkCreateShaderModule");
    if (device.checks.core)
        checkWords(device, command.member("pCreateInfo"), words);
    const VkResult result = device.next.CreateShaderModule(handle, info, allocator, module);
    if (result == VK_SUCCESS && (device.checks.gpu || device.checks.core))
        remember(device.objects, [&] {
            if (spirv::scan(words).tracesRays || !entryPointsOf(words).empty())
                device.objects.modules.set(*module,
                                           std::make_shared<const std::vector<uint32_t>>(words.begin(), words.end()));
        });
    return result;
}

void destroyShaderModule(DeviceValidation &device, VkDevice handle, VkShaderModule module,
                         const VkAllocationCallbacks *allocator)
{
    device.objects.modules.take(module);
    device.next.DestroyShaderModule(handle, module, allocator);
}

VkResult createComputePipelines(DeviceValidation &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                const VkComputePipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                VkPipeline *pipelines)
{
    const input::Pipelines checked = checkPipelines(device, count, infos);
    return createPipelines(device, count, infos, pipelines, checked, [&](const VkComputePipelineCreateInfo *own) {
        return device.next.CreateComputePipelines(handle, cache, count, own, allocator, pipelines);
    });
}

// As when the pipeline is created.
void getPipelineIndirectMemoryRequirements(DeviceValidation &device, VkDevice handle,
                                           const VkComputePipelineCreateInfo *info, VkMemoryRequirements2 *requirements)
{
    VkComputePipelineCreateInfo own = *info;
    MarkedPipelines marked(device.traces);
    marked.change(own);
    device.next.GetPipelineIndirectMemoryRequirementsNV(handle, &own, requirements);
}

VkResult createGraphicsPipelines(DeviceValidation &device, VkDevice handle, VkPipelineCache cache, uint32_t count,
                                 const VkGraphicsPipelineCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                 VkPipeline *pipelines)
{
    const input::Pipelines checked = checkPipelines(device, count, infos);
    return createPipelines(device, count, infos, pipelines, checked, [&](const VkGraphicsPipelineCreateInfo *own) {
        return device.next.CreateGraphicsPipelines(handle, cache, count, own, allocator, pipelines);
    });
}

VkResult createRayTracingPipelines(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR deferred,
                                   VkPipelineCache cache, uint32_t count,
                                   const VkRayTracingPipelineCreateInfoKHR *infos,
                                   const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    const auto create = [&](const VkRayTracingPipelineCreateInfoKHR *own) {
        return device.next.CreateRayTracingPipelinesKHR(handle, deferred, cache, count, own, allocator, pipelines);
    };
    input::Pipelines checked = checkPipelines(device, count, infos);
    if (!deferred)
        return createPipelines(device, count, infos, pipelines, std::move(checked), create);
    // The create infos of a deferred operation are used, and the handles are written, after this command.
    const input::Checked handed(infos, checked);
    const VkResult result = create(infos);
    if (result == VK_SUCCESS || result == VK_OPERATION_NOT_DEFERRED_KHR)
        keepLibraries(device, count, infos, pipelines);
    return result;
}

void destroyPipeline(DeviceValidation &device, VkDevice handle, VkPipeline pipeline,
                     const VkAllocationCallbacks *allocator)
{
    device.traces.pipelines.take(pipeline);
    device.objects.libraries.take(pipeline);
    device.next.DestroyPipeline(handle, pipeline, allocator);
}

VkResult createShaders(DeviceValidation &device, VkDevice handle, uint32_t count, const VkShaderCreateInfoEXT *infos,
                       const VkAllocationCallbacks *allocator, VkShaderEXT *shaders)
{
    input::Pipelines checked = checkShaders(device, count, infos);
    std::vector<VkShaderCreateInfoEXT> own(infos, infos + count);
    MarkedShaders marked(device.traces);
    for (VkShaderCreateInfoEXT &info : own)
        marked.change(info);
    const input::Checked handed(own.data(), checked);
    const VkResult result = device.next.CreateShadersEXT(handle, count, own.data(), allocator, shaders);
    marked.set(count, shaders);
    return result;
}

void destroyShader(DeviceValidation &device, VkDevice handle, VkShaderEXT shader,
                   const VkAllocationCallbacks *allocator)
{
    device.traces.shaders.take(shader);
    device.next.DestroyShaderEXT(handle, shader, allocator);
}

// A shader with marks writes to an address of this process, so no other process may get its code.
VkResult getShaderBinaryData(DeviceValidation &device, VkDevice handle, VkShaderEXT shader, size_t *bytes, void *data)
{
    if (!device.traces.shaders.get(shader))
        return device.next.GetShaderBinaryDataEXT(handle, shader, bytes, data);
    device.driver.report().warning("VELLUM-validation-shader-binary",
                                   "the binary of a shader that validation changed is not available");
    return VK_ERROR_OUT_OF_HOST_MEMORY;
}

// These run what is bound, except with a set of pipelines or shader objects, of which the device chooses.

void cmdExecuteGeneratedCommandsNV(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBool32 isPreprocessed,
                                   const VkGeneratedCommandsInfoNV *info)
{
    runTracing(device.traces, commandBuffer, info->pipelineBindPoint, "vkCmdExecuteGeneratedCommandsNV");
    device.next.CmdExecuteGeneratedCommandsNV(commandBuffer, isPreprocessed, info);
}

void cmdExecuteGeneratedCommandsEXT(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBool32 isPreprocessed,
                                    const VkGeneratedCommandsInfoEXT *info)
{
    const VkPipelineBindPoint point =
        (info->shaderStages & VK_SHADER_STAGE_COMPUTE_BIT) != 0 ? VK_PIPELINE_BIND_POINT_COMPUTE
        : (info->shaderStages & kRayTracingStages) != 0         ? VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR
                                                                : VK_PIPELINE_BIND_POINT_GRAPHICS;
    if (info->indirectExecutionSet == 0)
        runTracing(device.traces, commandBuffer, point, "vkCmdExecuteGeneratedCommandsEXT");
    device.next.CmdExecuteGeneratedCommandsEXT(commandBuffer, isPreprocessed, info);
}

} // namespace vellum::layer::validation
