// SPDX-License-Identifier: Apache-2.0
// Faults in shaders: the driver compiles other SPIR-V than the application's.
#include "faults/faults.h"

#include "spirv/module/code.h"
#include "spirv/module/integers.h"
#include "spirv/module/ray_instructions.h"

namespace faults
{
namespace
{

using namespace vellum::spirv;
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
        if (opcodeOf(instruction) == spv::OpExecutionModeId && instruction[2] == kExecutionModeOpacityMicromapId)
            operand = instruction[3];
        if (opcodeOf(instruction) == spv::OpSpecConstantFalse && instruction[2] == operand) {
            uint32_t &first = out[static_cast<size_t>(instruction.data() - words.data())];
            first = (first & 0xffff0000) | uint32_t{spv::OpSpecConstantTrue};
        }
        return true;
    });
    return out;
}

VKAPI_ATTR VkResult VKAPI_CALL createModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    std::vector<uint32_t> words(info->pCode, info->pCode + info->codeSize / 4);
    for (const FlagFault &fault : kFlagFaults) {
        if (has(keyOf(handle), fault.name))
            words = withFlags(words, fault.change);
    }
    if (has(keyOf(handle), "mode-constant-true"))
        words = withTrueMode(words);
    VkShaderModuleCreateInfo changed = *info;
    changed.codeSize = words.size() * 4;
    changed.pCode = words.data();
    return DRIVER_NEXT(vkCreateShaderModule)(handle, &changed, allocator, module);
}

} // namespace

LevelRows shaderRows()
{
    static const Row device[]{
        {"vkCreateShaderModule", DRIVER_FUNCTION(createModule)},
    };
    return {device, {}};
}

} // namespace faults
