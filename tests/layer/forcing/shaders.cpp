// SPDX-License-Identifier: Apache-2.0
// Shaders and pipelines: the micromap bit of ray tracing pipelines, and with VK_KHR_opacity_micromap the execution mode
// of modules with ray queries.
#include "forcing/forcing.h"

#include <array>
#include <deque>
#include <string>

#include "layer/base/pnext.h"
#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
#include "spirv/module/types.h"

namespace forcing
{
namespace
{

using vellum::layer::Chain;
namespace spirv = vellum::spirv;
namespace spv = vellum::spv;
using Words = std::vector<uint32_t>;

// The module with the execution mode; empty where it has no ray queries, or declares the mode itself.
Words withExecutionMode(const void *code, size_t bytes)
{
    constexpr uint32_t kRayQuery = 4472, kOpExecutionModeId = 331;
    std::string error;
    std::optional<spirv::Module> module =
        spirv::Module::parse({static_cast<const uint32_t *>(code), bytes / sizeof(uint32_t)}, error);
    if (!module || !module->hasCapability(kRayQuery) ||
        module->hasCapability(spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR))
        return {};
    const spirv::Id yes = spirv::Types(*module).constantTrue();
    module->append(spirv::Section::Capabilities, spv::OpCapability,
                   {spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR});
    module->append(spirv::Section::Extensions, spv::OpExtension, spirv::stringWords("SPV_KHR_opacity_micromap"));
    for (const spirv::Instruction entry : module->section(spirv::Section::EntryPoints))
        module->append(spirv::Section::ExecutionModes, kOpExecutionModeId,
                       {module->word(entry, 2), spv::ExecutionModeOpacityMicromapIdKHR, yes});
    ++counts.shaders;
    return module->serialize();
}

bool forcesShaders(const Device &device)
{
    return device.micromap && device.api == Api::Khr;
}

struct Module {
    Module(const Device &device, const VkShaderModuleCreateInfo &module) : info(module)
    {
        if (forcesShaders(device))
            words = withExecutionMode(info.pCode, info.codeSize);
        if (words.empty())
            return;
        info.pCode = words.data();
        info.codeSize = words.size() * sizeof(uint32_t);
    }
    VkShaderModuleCreateInfo info;
    Words words;
};

// Copies of the stages of a pipeline whose modules may be inline.
class Stages
{
public:
    void force(const Device &device, uint32_t count, const VkPipelineShaderStageCreateInfo *&stages)
    {
        if (!forcesShaders(device))
            return;
        stages_.assign(stages, stages + count);
        for (VkPipelineShaderStageCreateInfo &stage : stages_) {
            auto *module = chains_.emplace_back(stage.pNext)
                               .edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
            if (module == nullptr)
                continue;
            *module = modules_.emplace_back(device, *module).info;
            stage.pNext = chains_.back().head();
        }
        stages = stages_.data();
    }

private:
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
    std::deque<Chain> chains_;
    std::deque<Module> modules_;
};

} // namespace

struct Pipelines {
    Pipelines(const Device &device, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *all)
        : infos(all, all + count), stages(count)
    {
        constexpr VkFlags kBit = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
        for (uint32_t i = 0; i < count; ++i) {
            VkRayTracingPipelineCreateInfoKHR &info = infos[i];
            stages[i].force(device, info.stageCount, info.pStages);
            info.flags |= kBit;
            Chain &chain = chains.emplace_back(info.pNext);
            if (auto *flags = chain.edit<VkPipelineCreateFlags2CreateInfoKHR>(
                    VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR))
                flags->flags |= kBit;
            info.pNext = chain.head();
            ++counts.pipelines;
        }
    }
    std::vector<VkRayTracingPipelineCreateInfoKHR> infos;
    std::vector<Stages> stages;
    std::deque<Chain> chains;
};

Device::Device() = default;
Device::~Device() = default;

namespace
{

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    if (!device.micromap)
        return device.next.CreateRayTracingPipelinesKHR(handle, operation, cache, count, infos, allocator, pipelines);
    auto forced = std::make_unique<Pipelines>(device, count, infos);
    const VkResult result = device.next.CreateRayTracingPipelinesKHR(handle, operation, cache, count,
                                                                     forced->infos.data(), allocator, pipelines);
    if (operation != VK_NULL_HANDLE) {
        std::lock_guard lock(device.mutex);
        device.deferred[operation] = std::move(forced);
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyDeferredOperation(VkDevice handle, VkDeferredOperationKHR operation,
                                                    const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    {
        std::lock_guard lock(device.mutex);
        device.deferred.erase(operation);
    }
    device.next.DestroyDeferredOperationKHR(handle, operation, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphicsPipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                       const VkGraphicsPipelineCreateInfo *infos,
                                                       const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    std::vector<VkGraphicsPipelineCreateInfo> forced(infos, infos + count);
    std::vector<Stages> stages(count);
    for (uint32_t i = 0; i < count; ++i)
        stages[i].force(device, infos[i].stageCount, forced[i].pStages);
    return device.next.CreateGraphicsPipelines(handle, cache, count, forced.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    std::vector<VkComputePipelineCreateInfo> forced(infos, infos + count);
    std::vector<Stages> stages(count);
    for (uint32_t i = 0; i < count; ++i) {
        const VkPipelineShaderStageCreateInfo *stage = &infos[i].stage;
        stages[i].force(device, 1, stage);
        forced[i].stage = *stage;
    }
    return device.next.CreateComputePipelines(handle, cache, count, forced.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createShaderModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                                  const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    Device &device = deviceOf(handle);
    const Module forced(device, *info);
    return device.next.CreateShaderModule(handle, &forced.info, allocator, module);
}

VKAPI_ATTR void VKAPI_CALL getIdentifier(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                         VkShaderModuleIdentifierEXT *identifier)
{
    Device &device = deviceOf(handle);
    const Module forced(device, *info);
    device.next.GetShaderModuleCreateInfoIdentifierEXT(handle, &forced.info, identifier);
}

VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice handle, uint32_t count, const VkShaderCreateInfoEXT *infos,
                                             const VkAllocationCallbacks *allocator, VkShaderEXT *shaders)
{
    Device &device = deviceOf(handle);
    std::vector<VkShaderCreateInfoEXT> forced(infos, infos + count);
    std::deque<Words> code;
    for (VkShaderCreateInfoEXT &info : forced) {
        if (!forcesShaders(device) || info.codeType != VK_SHADER_CODE_TYPE_SPIRV_EXT)
            continue;
        code.push_back(withExecutionMode(info.pCode, info.codeSize));
        if (code.back().empty())
            continue;
        info.pCode = code.back().data();
        info.codeSize = code.back().size() * sizeof(uint32_t);
    }
    return device.next.CreateShadersEXT(handle, count, forced.data(), allocator, shaders);
}

} // namespace

std::span<const Row> shaderRows()
{
    static const std::array rows{
        FORCING_ROW("vkCreateRayTracingPipelinesKHR", createRayTracingPipelines),
        FORCING_ROW("vkDestroyDeferredOperationKHR", destroyDeferredOperation),
        FORCING_ROW("vkCreateGraphicsPipelines", createGraphicsPipelines),
        FORCING_ROW("vkCreateComputePipelines", createComputePipelines),
        FORCING_ROW("vkCreateShaderModule", createShaderModule),
        FORCING_ROW("vkGetShaderModuleCreateInfoIdentifierEXT", getIdentifier),
        FORCING_ROW("vkCreateShadersEXT", createShaders),
    };
    return rows;
}

} // namespace forcing
