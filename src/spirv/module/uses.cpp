// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/uses.h"

#include "spirv/module/numbers.h"
#include "spirv/module/ray_instructions.h"

namespace vellum::spirv
{

CallGraph::CallGraph(const Module &module)
{
    Id caller = 0;
    for (const Instruction in : module.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            caller = module.result(in);
        if (in.opcode != spv::OpFunctionCall)
            continue;
        callees_[caller].insert(module.word(in, 3));
        callers_[module.word(in, 3)].insert(caller);
    }
}

const std::set<Id> &CallGraph::callees(Id function) const
{
    static const std::set<Id> kNone;
    const auto found = callees_.find(function);
    return found == callees_.end() ? kNone : found->second;
}

std::set<Id> CallGraph::reachedFrom(std::vector<Id> functions) const
{
    return closure(callees_, std::move(functions));
}

std::set<Id> CallGraph::reaching(std::vector<Id> functions) const
{
    return closure(callers_, std::move(functions));
}

std::set<Id> CallGraph::closure(const Neighbours &neighbours, std::vector<Id> functions)
{
    std::set<Id> reached;
    while (!functions.empty()) {
        const Id next = functions.back();
        functions.pop_back();
        if (!reached.insert(next).second)
            continue;
        if (const auto found = neighbours.find(next); found != neighbours.end())
            functions.insert(functions.end(), found->second.begin(), found->second.end());
    }
    return reached;
}

namespace
{

// Longest chain of copies that is followed. In a malformed module an id can be a copy of itself.
constexpr int kMaxCopies = 64;

// Returns whether an instruction has the pointer among its operands. Other words may be literals that are equal to the
// id.
bool hasOperand(const Module &module, Instruction in, Id pointer)
{
    const auto among = [&](uint32_t first, uint32_t last) {
        for (uint32_t i = first; i <= last && i < in.count; ++i)
            if (module.word(in, i) == pointer)
                return true;
        return false;
    };
    switch (in.opcode) {
    case spv::OpLoad:
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpCopyObject: return among(3, 3);
    case spv::OpStore: return among(1, 1);
    case spv::OpCopyMemory:
    case spv::OpCopyMemorySized: return among(1, 2);
    case spv::OpFunctionCall: return among(4, in.count);
    case spv::OpExtInst: return among(5, in.count);
    default: {
        const auto ray = rayInstruction(in.opcode);
        return ray && ray->payload != 0 && module.word(in, ray->payload) == pointer;
    }
    }
}

} // namespace

bool isDebug(const Module &module, Instruction in)
{
    if (in.opcode == spv::OpLine || in.opcode == spv::OpNoLine)
        return true;
    if (in.opcode != spv::OpExtInst)
        return false;
    const std::string set = module.string(module.definition(module.word(in, 3)), 2);
    return set.starts_with("NonSemantic.Shader.DebugInfo") || set == "OpenCL.DebugInfo.100" || set == "DebugInfo";
}

Id copiedFrom(const Module &module, Id id)
{
    for (int i = 0; i < kMaxCopies; ++i) {
        const Instruction in = module.definition(id);
        const bool isChain = in.opcode == spv::OpAccessChain || in.opcode == spv::OpInBoundsAccessChain;
        if (in.opcode != spv::OpCopyObject && !(isChain && in.count == 4))
            break;
        id = module.word(in, 3);
    }
    return id;
}

bool usesPointer(const Module &module, const std::set<Id> &functions, Id pointer)
{
    Id function = 0;
    for (const Instruction in : module.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            function = module.result(in);
        if (functions.contains(function) && hasOperand(module, in, pointer))
            return true;
    }
    return false;
}

} // namespace vellum::spirv
