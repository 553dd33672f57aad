// SPDX-License-Identifier: Apache-2.0
// Shader modules, pipelines, shader objects, and commands that run generated commands.
#include "layer/base/pipeline_info.h"
#include "layer/base/pnext.h"
#include "layer/input/checked.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/pipeline_rules.h"
#include "layer/validation/traces/traced_code.h"
#include "spirv/module/scan.h"

namespace vellum::layer::validation
{
namespace
{

constexpr VkFlags64 kMixedPromise = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;
constexpr VkShaderStageFlags kRayTracingStages =
    VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
    VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;

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
    return result;
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
        if (const auto flags = device.traces.libraries.get(library); flags != 0 && (flags & kMixedPromise) == 0)
            device.at(place.element("pLibraries", i), {VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(library)})
                .report("VUID-VkGraphicsPipelineCreateInfo-pLibraries-11594", nullptr,
                        "the library was created without OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX, which the "
                        "pipeline has");
    }
}

} // namespace

VkResult createShaderModule(DeviceValidation &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    checkModule(device, *info);
    const VkResult result = device.next.CreateShaderModule(handle, info, allocator, module);
    if (result != VK_SUCCESS)
        return result;
    remember(device.objects, [&] {
        keepModule(device, *info, *module);
        const std::span<const uint32_t> words(info->pCode, info->codeSize / 4);
        if ((device.checks.gpu || device.checks.core) && spirv::scan(words).tracesRays)
            device.traces.modules.set(*module,
                                      std::make_shared<const std::vector<uint32_t>>(words.begin(), words.end()));
    });
    return result;
}

void destroyShaderModule(DeviceValidation &device, VkDevice handle, VkShaderModule module,
                         const VkAllocationCallbacks *allocator)
{
    device.traces.modules.take(module);
    device.objects.pipelines.modules.take(module);
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
    const Place command("vkCreateGraphicsPipelines");
    for (uint32_t i = 0; i < count && device.checks.core; ++i)
        checkLibraries(device, command.element("pCreateInfos", i), infos[i]);
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
    const input::Checked handed(infos, checked);
    // The create infos of a deferred operation are used, and the handles are written, after this command.
    const VkResult result =
        deferred ? create(infos) : createPipelines(device, count, infos, pipelines, checked, create);
    if (result == VK_SUCCESS || result == VK_OPERATION_NOT_DEFERRED_KHR)
        remember(device.objects, [&] { keepLibraries(device, count, infos, pipelines); });
    return result;
}

void destroyPipeline(DeviceValidation &device, VkDevice handle, VkPipeline pipeline,
                     const VkAllocationCallbacks *allocator)
{
    device.traces.pipelines.take(pipeline);
    device.traces.libraries.take(pipeline);
    device.objects.pipelines.libraries.take(pipeline);
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
