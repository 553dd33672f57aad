// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/micromap_mode.h"

#include <algorithm>

#include "spirv/module/numbers.h"
#include "spirv/module/ray_instructions.h"
#include "spirv/module/types.h"
#include "spirv/module/uses.h"

namespace vellum::spirv
{
namespace
{

using When = MicromapMode::When;
using To = ModeEdit::To;

constexpr uint32_t kModeCapability = spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR;

std::optional<uint32_t> specIdOf(const Module &module, Id constant)
{
    for (const Instruction in : module.section(Section::Decorations))
        if (in.opcode == spv::OpDecorate && module.word(in, 1) == constant &&
            module.word(in, 2) == spv::DecorationSpecId && in.count > 3)
            return module.word(in, 3);
    return {};
}

// The mode of each entry point that has one, by its function.
std::map<Id, MicromapMode> modesOf(const Module &module)
{
    std::map<Id, MicromapMode> modes;
    std::map<Id, Id> operands;
    for (const DeclaredMode &declared : declaredModes(module)) {
        const auto [operand, isNew] = operands.emplace(declared.function, declared.operand);
        if (isNew)
            modes[declared.function] = micromapMode(module, declared.operand);
        else if (operand->second != declared.operand)
            modes[declared.function] = {When::Invalid};
    }
    return modes;
}

// Functions that trace rays, themselves or in others that they call.
struct TracingFunctions {
    std::set<Id> queries; // by ray queries
    std::set<Id> traces;  // by rays of pipelines
};

TracingFunctions tracingFunctions(const Module &module)
{
    std::vector<Id> queries, traces;
    Id function = 0;
    for (const Instruction in : module.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            function = module.result(in);
        else if (in.opcode == spv::OpRayQueryInitializeKHR)
            queries.push_back(function);
        else if (const auto ray = rayInstruction(in.opcode); ray && ray->traces())
            traces.push_back(function);
    }
    const CallGraph calls(module);
    return {calls.reaching(std::move(queries)), calls.reaching(std::move(traces))};
}

std::vector<EntryPoint> entryPointsOf(const Module &module)
{
    const TracingFunctions tracing = tracingFunctions(module);
    const std::map<Id, MicromapMode> modes = modesOf(module);
    std::vector<EntryPoint> entries;
    for (const Instruction in : module.section(Section::EntryPoints)) {
        if (in.opcode != spv::OpEntryPoint)
            continue;
        EntryPoint &entry = entries.emplace_back();
        entry.name = module.string(in, 3);
        entry.model = module.word(in, 1);
        entry.function = module.word(in, 2);
        entry.queries = tracing.queries.contains(entry.function);
        entry.traces = tracing.traces.contains(entry.function);
        if (const auto mode = modes.find(entry.function); mode != modes.end())
            entry.mode = mode->second;
    }
    return entries;
}

std::string namesOf(const std::vector<EntryPoint> &entryPoints)
{
    std::string names;
    for (const EntryPoint &entry : entryPoints)
        names += (names.empty() ? "" : ", ") + entry.name;
    return names.empty() ? "no entry points" : names;
}

// One edit of a module.
class Edit
{
public:
    Edit(Module &module, const ModeEdit &wanted)
        : module_(module), types_(module), wanted_(wanted), entryPoints_(entryPointsOf(module))
    {
    }

    // Returns whether it has changed the module. False with error() set on failure.
    bool run()
    {
        if (!chooseTargets() || !isNeeded())
            return false;
        if (wanted_.to != To::Absent && !checkModule())
            return false;
        const Id operand = wanted_.to == To::Absent ? 0 : constant();
        if (!error_.empty())
            return false;
        std::erase_if(module_.section(Section::ExecutionModes), [&](Instruction in) {
            return isMicromapMode(module_.words(in)) && targets_.contains(module_.word(in, 1));
        });
        if (wanted_.to != To::Absent)
            declare(operand);
        else if (!keepsModes())
            removeDeclarations();
        return true;
    }

    [[nodiscard]] const std::string &error() const { return error_; }

private:
    bool fail(std::string error)
    {
        error_ = std::move(error);
        return false;
    }

    // Chooses the entry points to edit.
    bool chooseTargets()
    {
        for (const std::string &name : wanted_.entryPoints)
            if (std::ranges::find(entryPoints_, name, &EntryPoint::name) == entryPoints_.end())
                return fail("there is no entry point " + name + "; the module has " + namesOf(entryPoints_));
        for (const EntryPoint &entry : entryPoints_) {
            const bool chosen = wanted_.entryPoints.empty()
                                    ? wanted_.to == To::Absent || entry.queries
                                    : std::ranges::find(wanted_.entryPoints, entry.name) != wanted_.entryPoints.end();
            if (chosen)
                targets_.insert(entry.function);
        }
        return true;
    }

    // Returns whether any entry point or declaration is not what it should be.
    [[nodiscard]] bool isNeeded() const
    {
        if (targets_.empty())
            return false;
        if (wanted_.to == To::Absent)
            return removesAny() || (!keepsModes() && module_.hasCapability(kModeCapability));
        const MicromapMode wanted = wanted_.to == To::Always
                                        ? MicromapMode{When::Always}
                                        : MicromapMode{When::Specialized, wanted_.constantId, wanted_.initial};
        return !module_.hasCapability(kModeCapability) || !module_.hasExtension(kKhrExtension) ||
               std::ranges::any_of(entryPoints_, [&](const EntryPoint &entry) {
                   return targets_.contains(entry.function) && entry.mode != wanted;
               });
    }

    [[nodiscard]] bool removesAny() const
    {
        return std::ranges::any_of(declaredModes(module_),
                                   [&](const auto &mode) { return targets_.contains(mode.function); });
    }
    // Returns whether entry points that are not edited have the mode.
    [[nodiscard]] bool keepsModes() const
    {
        return std::ranges::any_of(declaredModes(module_),
                                   [&](const auto &mode) { return !targets_.contains(mode.function); });
    }

    bool checkModule()
    {
        const uint32_t version = module_.version();
        if (version < kVersion14)
            return fail("SPV_KHR_opacity_micromap needs SPIR-V 1.4; the module has " + std::to_string(version >> 16) +
                        "." + std::to_string(version >> 8 & 0xff));
        constexpr uint32_t kMostNewIds = 2;
        return module_.bound() <= kMaxBound - kMostNewIds ||
               fail("the bound of its ids is " + std::to_string(module_.bound()));
    }

    // The operand of the mode, which is added if the module has none.
    Id constant()
    {
        if (wanted_.to == To::Always)
            return types_.constantTrue();
        for (const Instruction in : module_.section(Section::Decorations)) {
            if (in.opcode == spv::OpDecorate && module_.word(in, 2) == spv::DecorationSpecId && in.count > 3 &&
                module_.word(in, 3) == wanted_.constantId) {
                checkConstant(module_.word(in, 1));
                return module_.word(in, 1);
            }
        }
        const Id type = types_.boolean();
        const Id made = module_.newId();
        module_.append(Section::Decorations, spv::OpDecorate, {made, spv::DecorationSpecId, wanted_.constantId});
        module_.append(Section::Globals, wanted_.initial ? spv::OpSpecConstantTrue : spv::OpSpecConstantFalse,
                       {type, made});
        return made;
    }

    void checkConstant(Id constant)
    {
        const std::string name = "the specialization constant " + std::to_string(wanted_.constantId);
        const MicromapMode known = micromapMode(module_, constant);
        if (known.when != When::Specialized)
            fail(name + " of the module is not of type bool");
        else if (known.initial != wanted_.initial)
            fail(name + " of the module has the default " + (known.initial ? "true" : "false"));
    }

    void declare(Id operand)
    {
        if (!module_.hasCapability(kModeCapability))
            module_.append(Section::Capabilities, spv::OpCapability, {kModeCapability});
        if (!module_.hasExtension(kKhrExtension))
            module_.append(Section::Extensions, spv::OpExtension, stringWords(kKhrExtension));
        for (const Id function : targets_)
            module_.append(Section::ExecutionModes, spv::OpExecutionModeId,
                           {function, spv::ExecutionModeOpacityMicromapIdKHR, operand});
    }

    void removeDeclarations()
    {
        std::erase_if(module_.section(Section::Capabilities), [&](Instruction in) {
            return in.opcode == spv::OpCapability && module_.word(in, 1) == kModeCapability;
        });
        // The extension has the capability of a ray flag as well.
        if (module_.hasCapability(spv::CapabilityRayTracingOpacityMicromapKHR) && !module_.hasExtension(kExtExtension))
            return;
        std::erase_if(module_.section(Section::Extensions), [&](Instruction in) {
            return in.opcode == spv::OpExtension && module_.string(in, 1) == kKhrExtension;
        });
    }

    Module &module_;
    Types types_;
    const ModeEdit &wanted_;
    const std::vector<EntryPoint> entryPoints_;
    std::set<Id> targets_; // functions
    std::string error_;
};

} // namespace

bool isMicromapMode(Words in)
{
    const uint32_t opcode = opcodeOf(in);
    return (opcode == spv::OpExecutionMode || opcode == spv::OpExecutionModeId) && in.size() > 2 &&
           in[2] == spv::ExecutionModeOpacityMicromapIdKHR;
}

std::vector<DeclaredMode> declaredModes(const Module &module)
{
    std::vector<DeclaredMode> modes;
    for (const Instruction in : module.section(Section::ExecutionModes))
        if (isMicromapMode(module.words(in)))
            modes.push_back({module.word(in, 1), in.opcode == spv::OpExecutionModeId ? module.word(in, 3) : 0});
    return modes;
}

MicromapMode micromapMode(const Module &module, Id operand)
{
    const Instruction in = module.definition(operand);
    if (!module.isGlobal(operand) || module.definition(module.resultType(in)).opcode != spv::OpTypeBool)
        return {When::Invalid};
    switch (in.opcode) {
    case spv::OpConstantTrue: return {When::Always};
    case spv::OpConstantFalse:
    case spv::OpConstantNull: return {When::Never};
    case spv::OpSpecConstantTrue:
    case spv::OpSpecConstantFalse: {
        const bool initial = in.opcode == spv::OpSpecConstantTrue;
        if (const auto id = specIdOf(module, operand))
            return {When::Specialized, *id, initial};
        return {initial ? When::Always : When::Never}; // nothing can specialize it
    }
    case spv::OpSpecConstantOp: return {When::Computed};
    default: return {When::Invalid};
    }
}

std::optional<std::vector<EntryPoint>> readEntryPoints(std::span<const uint32_t> words, std::string &error)
{
    const std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return {};
    return entryPointsOf(*module);
}

ModeResult editMicromapMode(std::span<const uint32_t> words, const ModeEdit &edit)
{
    ModeResult result;
    std::optional<Module> module = Module::parse(words, result.error);
    if (!module)
        return result;
    Edit run(*module, edit);
    if (run.run())
        result.words = module->serialize();
    result.error = run.error();
    return result;
}

} // namespace vellum::spirv
