// SPDX-License-Identifier: Apache-2.0
// Faults in shaders: the driver compiles other SPIR-V than the application's.
#include "faulty_driver/faults.h"

#include <deque>

#include "layer/base/pnext.h"
#include "spirv/module/code.h"
#include "spirv/module/ray_instructions.h"

namespace faults
{
namespace
{

using namespace vellum::spirv;
namespace spv = vellum::spv;
using vellum::layer::Chain;
constexpr Level kLevel = Level::Shaders;

constexpr uint32_t kTerminateOnFirstHit = 0x004;
constexpr uint32_t kCullOpaque = 0x040;
constexpr uint32_t kForceTwoState = 0x400;

// Returns the id of the ray flags that are used instead.
using ChangeFlags = Id (*)(Types &, Id flags, Code &);

Id withoutForceTwoState(Types &types, Id flags, Code &code)
{
    return maskBits(types, flags, ~kForceTwoState, code);
}

Id withoutCullOpaque(Types &types, Id flags, Code &code)
{
    return maskBits(types, flags, ~kCullOpaque, code);
}

// ForceOpacityMicromap2State is 8 bits above TerminateOnFirstHit.
Id terminateOrForce(Types &types, Id flags, Code &code)
{
    static_assert(kTerminateOnFirstHit << 8 == kForceTwoState);
    const Id uint = types.uint32();
    const Id moved = code.value(spv::OpShiftLeftLogical, uint, {flags, types.uintConstant(8)});
    const Id forbidden = code.value(spv::OpBitwiseAnd, uint, {moved, types.uintConstant(kForceTwoState)});
    return code.value(spv::OpBitwiseAnd, uint, {flags, code.value(spv::OpNot, uint, {forbidden})});
}

struct FlagFault {
    const char *name;
    ChangeFlags change;
};
constexpr FlagFault kFlagFaults[]{
    {"ray-2-state-ignored", withoutForceTwoState},
    {"cull-opaque-ignored", withoutCullOpaque},
    {"terminating-rays-ignore-2-state", terminateOrForce},
};

// The word of an instruction that holds ray flags; 0 if it has none.
uint32_t flagsWord(const Instruction &instruction)
{
    if (instruction.opcode == spv::OpRayQueryInitializeKHR)
        return 3;
    const auto ray = rayInstruction(instruction.opcode);
    return ray ? ray->flags : 0;
}

std::vector<uint32_t> withFlags(Words words, ChangeFlags change)
{
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return {words.begin(), words.end()};
    Types types(*module);
    std::vector<Instruction> changed;
    for (const Instruction &instruction : std::vector(module->section(Section::Functions))) {
        if (const uint32_t word = flagsWord(instruction); word != 0) {
            Code code(*module);
            const Id flags = module->word(instruction, word);
            const Id type = module->resultType(module->definition(flags));
            const Id instead = change(types, toUint(types, type, flags, code), code);
            changed.insert(changed.end(), code.out.begin(), code.out.end());
            changed.push_back(module->with(instruction, word, instead));
        } else {
            changed.push_back(instruction);
        }
    }
    module->section(Section::Functions) = std::move(changed);
    return module->serialize();
}

// The specialization constants of the execution mode that default to false default to true.
std::vector<uint32_t> withTrueMode(Words words)
{
    std::vector<uint32_t> out(words.begin(), words.end());
    Id operand = 0;
    visitInstructions(words, [&](Words instruction) {
        if (opcodeOf(instruction) == spv::OpExecutionModeId && instruction[2] == spv::ExecutionModeOpacityMicromapIdKHR)
            operand = instruction[3];
        if (opcodeOf(instruction) == spv::OpSpecConstantFalse && instruction[2] == operand) {
            uint32_t &first = out[static_cast<size_t>(instruction.data() - words.data())];
            first = (first & 0xffff0000) | uint32_t{spv::OpSpecConstantTrue};
        }
        return true;
    });
    return out;
}

std::vector<uint32_t> changed(void *key, const VkShaderModuleCreateInfo &info)
{
    std::vector<uint32_t> words(info.pCode, info.pCode + info.codeSize / 4);
    for (const FlagFault &fault : kFlagFaults) {
        if (has(key, fault.name))
            words = withFlags(words, fault.change);
    }
    return has(key, "mode-constant-true") ? withTrueMode(words) : words;
}

VKAPI_ATTR VkResult VKAPI_CALL createModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    const auto create = DRIVER_NEXT(vkCreateShaderModule);
    if (!hasAny(keyOf(handle), kLevel))
        return create(handle, info, allocator, module);
    const std::vector<uint32_t> words = changed(keyOf(handle), *info);
    VkShaderModuleCreateInfo own = *info;
    own.codeSize = words.size() * 4;
    own.pCode = words.data();
    return create(handle, &own, allocator, module);
}

// Stages of pipelines whose modules are given in their pNext chains.
class Stages
{
public:
    Stages(void *key, std::span<const VkPipelineShaderStageCreateInfo> stages) : stages_(stages.begin(), stages.end())
    {
        for (VkPipelineShaderStageCreateInfo &stage : stages_) {
            Chain &chain = chains_.emplace_back(stage.pNext);
            auto *info = chain.edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
            if (stage.module != VK_NULL_HANDLE || info == nullptr)
                continue;
            const std::vector<uint32_t> &words = words_.emplace_back(changed(key, *info));
            info->codeSize = words.size() * 4;
            info->pCode = words.data();
            stage.pNext = chain.head();
        }
    }
    [[nodiscard]] const VkPipelineShaderStageCreateInfo *data() const { return stages_.data(); }

private:
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint32_t>> words_;
};

template <class Info>
struct Pipelines {
    Pipelines(void *key, std::span<const Info> given) : infos(given.begin(), given.end())
    {
        for (Info &info : infos)
            info.pStages = stages.emplace_back(key, std::span(info.pStages, info.stageCount)).data();
    }
    std::vector<Info> infos;
    std::deque<Stages> stages;
};

VKAPI_ATTR VkResult VKAPI_CALL createCompute(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                             const VkComputePipelineCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    const auto create = DRIVER_NEXT(vkCreateComputePipelines);
    if (!hasAny(keyOf(handle), kLevel))
        return create(handle, cache, count, infos, allocator, pipelines);
    std::vector<VkComputePipelineCreateInfo> own(infos, infos + count);
    std::deque<Stages> stages;
    for (VkComputePipelineCreateInfo &info : own)
        info.stage = *stages.emplace_back(keyOf(handle), std::span(&info.stage, 1)).data();
    return create(handle, cache, count, own.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphics(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                              const VkGraphicsPipelineCreateInfo *infos,
                                              const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    const auto create = DRIVER_NEXT(vkCreateGraphicsPipelines);
    if (!hasAny(keyOf(handle), kLevel))
        return create(handle, cache, count, infos, allocator, pipelines);
    const Pipelines<VkGraphicsPipelineCreateInfo> own(keyOf(handle), {infos, count});
    return create(handle, cache, count, own.infos.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracing(VkDevice handle, VkDeferredOperationKHR operation,
                                                VkPipelineCache cache, uint32_t count,
                                                const VkRayTracingPipelineCreateInfoKHR *infos,
                                                const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    const auto create = DRIVER_NEXT(vkCreateRayTracingPipelinesKHR);
    // A deferred creation may read the copies later.
    if (operation != VK_NULL_HANDLE || !hasAny(keyOf(handle), kLevel))
        return create(handle, operation, cache, count, infos, allocator, pipelines);
    const Pipelines<VkRayTracingPipelineCreateInfoKHR> own(keyOf(handle), {infos, count});
    return create(handle, operation, cache, count, own.infos.data(), allocator, pipelines);
}

} // namespace

LevelRows shaderRows()
{
    static const Row device[]{
        {"vkCreateShaderModule", DRIVER_FUNCTION(createModule)},
        {"vkCreateComputePipelines", DRIVER_FUNCTION(createCompute)},
        {"vkCreateGraphicsPipelines", DRIVER_FUNCTION(createGraphics)},
        {"vkCreateRayTracingPipelinesKHR", DRIVER_FUNCTION(createRayTracing)},
    };
    return {device, {}};
}

} // namespace faults
