// SPDX-License-Identifier: Apache-2.0
#include "spirv/sites/trace_sites.h"

#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/module/numbers.h"
#include "spirv/module/ray_instructions.h"
#include "spirv/module/uses.h"

#include "shaders/traced.h"

namespace vellum::spirv
{
namespace
{

// The operand of an instruction that traces rays; 0 for others. Ray flags and the cull mask follow it.
uint32_t structureOperand(Instruction in)
{
    if (in.opcode == spv::OpRayQueryInitializeKHR)
        return 2;
    const auto ray = rayInstruction(in.opcode);
    return ray && ray->traces() ? ray->flags - 1 : 0;
}

std::optional<uint32_t> decorationOf(const Module &module, Id id, uint32_t decoration)
{
    for (const Instruction in : module.section(Section::Decorations))
        if (in.opcode == spv::OpDecorate && module.word(in, 1) == id && module.word(in, 2) == decoration)
            return module.word(in, 3);
    return {};
}

std::optional<StructureBinding> bindingOf(const Module &module, const Types &types, Id structure)
{
    const Instruction load = module.definition(copiedFrom(module, structure));
    if (load.opcode != spv::OpLoad)
        return {};
    Id pointer = copiedFrom(module, module.word(load, 3));
    StructureBinding binding;
    binding.element = 0;
    const Instruction chain = module.definition(pointer);
    if (chain.opcode == spv::OpAccessChain || chain.opcode == spv::OpInBoundsAccessChain) {
        if (chain.count != 5)
            return {};
        pointer = copiedFrom(module, module.word(chain, 3));
        binding.element = types.valueOf(module.word(chain, 4));
    }
    const auto set = decorationOf(module, pointer, spv::DecorationDescriptorSet);
    const auto number = decorationOf(module, pointer, spv::DecorationBinding);
    if (module.definition(pointer).opcode != spv::OpVariable || !set || !number)
        return {};
    binding.set = *set;
    binding.binding = *number;
    return binding;
}

std::set<Id> functionsOf(const Module &module, const StageName &stage)
{
    for (const Instruction in : module.section(Section::EntryPoints))
        if (in.opcode == spv::OpEntryPoint && module.word(in, 1) == stage.executionModel &&
            module.string(in, 3) == stage.entryPoint)
            return CallGraph(module).reachedFrom({module.word(in, 2)});
    return {};
}

// Calls visit(instruction, whether it is a site of the stage) for each instruction of the module's functions.
template <typename Visit>
void visitSites(const Module &module, const StageName &stage, Visit visit)
{
    const std::set<Id> reached = functionsOf(module, stage);
    const std::vector<Instruction> functions = module.section(Section::Functions);
    Id function = 0;
    for (const Instruction in : functions) {
        if (in.opcode == spv::OpFunction)
            function = module.result(in);
        visit(in, structureOperand(in) != 0 && reached.contains(function));
    }
}

} // namespace

std::vector<TraceSite> traceSites(std::span<const uint32_t> words, const StageName &stage)
{
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return {};
    const Types types(*module);
    std::vector<TraceSite> sites;
    visitSites(*module, stage, [&](Instruction in, bool isSite) {
        if (!isSite)
            return;
        const uint32_t structure = structureOperand(in);
        TraceSite &site = sites.emplace_back();
        site.query = in.opcode == spv::OpRayQueryInitializeKHR;
        site.binding = bindingOf(*module, types, module->word(in, structure));
        if (const auto mask = types.valueOf(module->word(in, structure + 2)))
            site.cullMask = *mask & 0xff;
    });
    return sites;
}

std::vector<uint32_t> markTraces(std::span<const uint32_t> words, const StageName &stage, uint64_t address,
                                 std::span<const uint32_t> marks)
{
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return {};
    Types types(*module);
    Linker linker(*module, types, traced,
                  {{0, static_cast<uint32_t>(address)}, {1, static_cast<uint32_t>(address >> 32)}});
    const Id mark = linker.function("vellumTraced");
    Code code(*module);
    size_t site = 0;
    visitSites(*module, stage, [&](Instruction in, bool isSite) {
        const uint32_t number = isSite && site < marks.size() ? marks[site++] : UINT32_MAX;
        if (number != UINT32_MAX)
            code.value(spv::OpFunctionCall, types.none(), {mark, types.uintConstant(number)});
        code.out.push_back(in);
    });
    module->section(Section::Functions) = std::move(code.out);
    return linker.finish() ? module->serialize() : std::vector<uint32_t>();
}

} // namespace vellum::spirv
