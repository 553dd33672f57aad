// SPDX-License-Identifier: Apache-2.0
#include "spirv/consumption.h"

#include "spirv/module/micromap_mode.h"
#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"

namespace vellum::spirv
{
namespace
{

using When = Consumes::When;

} // namespace

// The declaration of one execution mode.
std::optional<Consumes> Consumption::declared(const DeclaredMode &mode)
{
    if (mode.operand == 0) {
        error_ = "its execution mode OpacityMicromapIdKHR has no operand, which is an id of OpExecutionModeId";
        return {};
    }
    switch (micromapMode(module_, mode.operand).when) {
    case MicromapMode::When::Always: return Consumes{When::Always};
    case MicromapMode::When::Never: return Consumes{When::Never};
    case MicromapMode::When::Specialized:
    case MicromapMode::When::Computed: return Consumes{When::If, mode.operand};
    default: break;
    }
    error_ = "the operand of its execution mode OpacityMicromapIdKHR, id " + std::to_string(mode.operand) +
             ", is no constant of type bool";
    return {};
}

bool Consumption::read(const RewriteOptions &options)
{
    if (options.queriesConsume == QueriesConsume::Always)
        return true;
    std::map<Id, Consumes> modes;
    for (const DeclaredMode &mode : declaredModes(module_)) {
        const auto consumes = declared(mode);
        if (!consumes)
            return false;
        const auto [known, isNew] = modes.emplace(mode.function, *consumes);
        if (!isNew && known->second != *consumes) {
            error_ = "an entry point has the execution mode OpacityMicromapIdKHR twice, with different operands";
            return false;
        }
    }
    anyDeclared_ = !modes.empty();
    const auto &stage = options.pipelineStage;
    for (const Instruction in : module_.section(Section::EntryPoints)) {
        if (in.opcode != spv::OpEntryPoint ||
            (stage && (module_.word(in, 1) != stage->executionModel || module_.string(in, 3) != stage->entryPoint)))
            continue;
        const Id function = module_.word(in, 2);
        const auto mode = modes.find(function);
        entries_[function] = mode == modes.end() ? Consumes{} : mode->second;
    }
    otherwise_ = entries_.empty() ? Consumes{} : entries_.begin()->second;
    for (const auto &[function, consumes] : entries_)
        if (consumes != otherwise_)
            otherwise_ = {When::Mixed};
    spread();
    return true;
}

// From callers to callees. The value of a function changes at most twice: from nothing to that of one entry point, and
// to Mixed.
void Consumption::spread()
{
    const CallGraph calls(module_);
    std::vector<std::pair<Id, Consumes>> work(entries_.begin(), entries_.end());
    while (!work.empty()) {
        const auto [reached, consumes] = work.back();
        work.pop_back();
        const auto [known, isNew] = functions_.emplace(reached, consumes);
        if (!isNew) {
            if (known->second == consumes || known->second.when == When::Mixed)
                continue;
            known->second = {When::Mixed};
        }
        for (const Id callee : calls.callees(reached))
            work.emplace_back(callee, known->second);
    }
}

Consumes Consumption::in(Id function) const
{
    const auto known = functions_.find(function);
    return known == functions_.end() ? otherwise_ : known->second;
}

Id Consumption::condition(const Consumes &consumes, Code &out)
{
    if (consumes.when == When::If)
        return consumes.condition;
    const Id boolean = types_.boolean();
    if (variable_ == 0)
        variable_ = addPrivateVariable(module_, types_, boolean);
    return out.value(spv::OpLoad, boolean, {variable_});
}

namespace
{

// The last variable of the function that begins there, or the label of its first block: variables come first in it.
size_t lastVariable(const std::vector<Instruction> &code, size_t function)
{
    size_t last = function;
    for (size_t i = function; code[i].opcode != spv::OpFunctionEnd; ++i) {
        const bool isLabel = code[i].opcode == spv::OpLabel;
        if (isLabel && last != function)
            break;
        if (isLabel || code[i].opcode == spv::OpVariable || code[i].opcode == spv::OpUntypedVariableKHR)
            last = i;
    }
    return last;
}

} // namespace

bool Consumption::finish()
{
    if (variable_ == 0)
        return true;
    std::vector<Instruction> out;
    const std::vector<Instruction> code = module_.section(Section::Functions);
    std::map<size_t, Id> stores; // values, by the instruction that comes before
    for (size_t i = 0; i < code.size(); ++i) {
        const auto entry = code[i].opcode == spv::OpFunction ? entries_.find(module_.result(code[i])) : entries_.end();
        if (entry != entries_.end()) {
            const Consumes &consumes = entry->second;
            const bool always = consumes.when == Consumes::When::Always;
            stores[lastVariable(code, i)] =
                consumes.when == Consumes::When::If
                    ? consumes.condition
                    : types_.get(always ? spv::OpConstantTrue : spv::OpConstantFalse, {types_.boolean()});
        }
        out.push_back(code[i]);
        if (const auto store = stores.find(i); store != stores.end() && code[i].opcode != spv::OpFunction)
            out.push_back(module_.make(spv::OpStore, {variable_, store->second}));
    }
    module_.section(Section::Functions) = std::move(out);
    if (module_.addToInterfaces({variable_}))
        return true;
    error_ = kTooLongInterface;
    return false;
}

} // namespace vellum::spirv
