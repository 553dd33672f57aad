// SPDX-License-Identifier: Apache-2.0
#include "machine.h"

#include "spirv/module/numbers.h"
#include "spirv/module/ray_instructions.h"

#include <stdexcept>

namespace vellum::test
{
namespace
{

using spirv::Id;
using spirv::Instruction;
using spirv::Section;

constexpr int kMaxSteps = 10000;

spirv::Module parse(const std::vector<uint32_t> &words)
{
    std::string error;
    auto module = spirv::Module::parse(words, error);
    if (!module)
        throw std::runtime_error(error);
    return *module;
}

} // namespace

Machine::Machine(const std::vector<uint32_t> &words, std::vector<Candidate> script,
                 const std::map<uint32_t, uint32_t> &specialization)
    : module_(parse(words)), script_(std::move(script))
{
    for (const Instruction in : module_.section(Section::Decorations))
        if (in.opcode == spv::OpDecorate && module_.word(in, 2) == spv::DecorationSpecId)
            if (const auto it = specialization.find(module_.word(in, 3)); it != specialization.end())
                specialized_[module_.word(in, 1)] = it->second;
    for (const Instruction in : module_.section(Section::Names))
        if (in.opcode == spv::OpName)
            names_[module_.word(in, 1)] = module_.string(in, 2);
    const auto &code = module_.section(Section::Functions);
    for (size_t i = 0; i < code.size(); ++i) {
        if (code[i].opcode == spv::OpLabel)
            labels_[module_.word(code[i], 1)] = i;
        if (code[i].opcode == spv::OpFunction)
            functions_[module_.word(code[i], 2)] = i;
    }
}

std::vector<uint32_t> Machine::run(const std::string &entryPoint)
{
    for (const Instruction in : module_.section(Section::EntryPoints))
        if (module_.string(in, 3) == entryPoint)
            call(module_.word(in, 2), {});
    if (steps_ >= kMaxSteps)
        seen_.push_back(~0u);
    return seen_;
}

uint32_t Machine::value(Id id) const
{
    const Instruction in = module_.definition(id);
    if (module_.isGlobal(id) && in.opcode != spv::OpVariable)
        return constant(in);
    const auto it = values_.find(id);
    return it == values_.end() ? 0 : it->second;
}

uint32_t Machine::constant(Instruction in) const
{
    const auto specialized = specialized_.find(module_.result(in));
    if (specialized != specialized_.end())
        return specialized->second;
    switch (in.opcode) {
    case spv::OpConstant:
    case spv::OpSpecConstant: return module_.word(in, 3);
    case spv::OpConstantTrue:
    case spv::OpSpecConstantTrue: return 1;
    case spv::OpSpecConstantOp: {
        const uint32_t a = value(module_.word(in, 4)), b = value(module_.word(in, 5));
        switch (module_.word(in, 3)) {
        case spv::OpLogicalNot: return a == 0;
        case spv::OpIEqual: return a == b;
        default: throw std::runtime_error("OpSpecConstantOp of opcode " + std::to_string(module_.word(in, 3)));
        }
    }
    default: return 0;
    }
}

void Machine::branch(Id to)
{
    // All phis of a block are read before any of them is written.
    const auto &code = module_.section(Section::Functions);
    at_ = labels_.at(to);
    std::map<Id, uint32_t> next;
    while (code[++at_].opcode == spv::OpPhi) {
        const Instruction in = code[at_];
        bool found = false;
        for (uint32_t i = 3; i < in.count; i += 2)
            if (module_.word(in, i + 1) == block_) {
                next[module_.word(in, 2)] = value(module_.word(in, i));
                found = true;
            }
        if (!found)
            throw std::runtime_error("phi without an entry for where control came from");
    }
    for (const auto &[id, v] : next)
        values_[id] = v;
    block_ = to;
}

uint32_t Machine::call(Id function, const std::vector<uint32_t> &arguments)
{
    if (names_[function] == "vellumCandidate")
        return script_.at(position_ - 1).decided;

    const auto &code = module_.section(Section::Functions);
    at_ = functions_.at(function);
    size_t argument = 0;
    while (code[++at_].opcode == spv::OpFunctionParameter)
        values_[module_.word(code[at_], 2)] = arguments.at(argument++);
    block_ = module_.word(code[at_], 1);
    for (++at_; ++steps_ < kMaxSteps;) {
        const Instruction in = code[at_];
        switch (in.opcode) {
        case spv::OpBranch: branch(module_.word(in, 1)); break;
        case spv::OpBranchConditional: branch(module_.word(in, value(module_.word(in, 1)) != 0 ? 2 : 3)); break;
        case spv::OpSwitch: {
            Id to = module_.word(in, 2);
            for (uint32_t i = 3; i < in.count; i += 2)
                if (module_.word(in, i) == value(module_.word(in, 1)))
                    to = module_.word(in, i + 1);
            branch(to);
            break;
        }
        case spv::OpReturn: return 0;
        case spv::OpReturnValue: return value(module_.word(in, 1));
        case spv::OpFunctionCall: {
            std::vector<uint32_t> values;
            for (uint32_t i = 4; i < in.count; ++i) {
                values.push_back(value(module_.word(in, i)));
                const Instruction parameter = code[functions_.at(module_.word(in, 3)) + i - 3];
                if (module_.definition(module_.word(parameter, 1)).opcode == spv::OpTypePointer)
                    arguments_[module_.word(parameter, 2)] = variable(module_.word(in, i));
            }
            const size_t back = at_ + 1;
            const Id block = block_;
            values_[module_.word(in, 2)] = call(module_.word(in, 3), values);
            at_ = back;
            block_ = block;
            break;
        }
        default: {
            const uint32_t v = evaluate(in);
            if (const Id id = module_.result(in))
                values_[id] = v;
            ++at_;
        }
        }
    }
    return 0;
}

uint32_t Machine::evaluate(Instruction in)
{
    const auto a = value(module_.word(in, 3)), b = value(module_.word(in, 4)), c = value(module_.word(in, 5));
    switch (in.opcode) {
    case spv::OpIAdd: return a + b;
    case spv::OpIMul: return a * b;
    case spv::OpBitwiseAnd: return a & b;
    case spv::OpBitwiseXor: return a ^ b;
    case spv::OpBitwiseOr: return a | b;
    case spv::OpShiftLeftLogical: return a << b;
    case spv::OpShiftRightLogical: return a >> b;
    case spv::OpIEqual: return a == b;
    case spv::OpINotEqual: return a != b;
    case spv::OpULessThan: return a < b;
    case spv::OpLogicalNot: return a == 0;
    case spv::OpLogicalAnd: return (a & b) != 0;
    case spv::OpLogicalOr: return (a | b) != 0;
    case spv::OpCopyObject:
    case spv::OpBitcast: return a;
    case spv::OpSelect: return a != 0 ? b : c;
    case spv::OpLoad: return variables_[variable(module_.word(in, 3))];
    case spv::OpStore:
        variables_[variable(module_.word(in, 1))] = value(module_.word(in, 2));
        if (module_.definition(module_.word(in, 1)).opcode == spv::OpAccessChain)
            seen_.push_back(value(module_.word(in, 2)));
        return 0;
    case spv::OpRayQueryProceedKHR:
        if (position_ < script_.size())
            return ++position_, 1;
        return 0;
    case spv::OpRayQueryGetIntersectionPrimitiveIndexKHR: return script_.at(position_ - 1).name;
    case spv::OpRayQueryConfirmIntersectionKHR: seen_.push_back(script_.at(position_ - 1).name | 0x1000); return 0;
    case spv::OpUndef:
    case spv::OpVariable:
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpLoopMerge:
    case spv::OpSelectionMerge:
    case spv::OpLine:
    case spv::OpNoLine:
    case spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR: return 0;
    case spv::OpRayQueryInitializeKHR: rayFlags_ = value(module_.word(in, 3)); return 0;
    case spv::OpRayQueryGetRayFlagsKHR: return rayFlags_;
    case spv::OpHitObjectGetRayFlagsEXT: return hitObjectFlags_[variable(module_.word(in, 3))];
    default: return evaluateRay(in);
    }
}

Id Machine::variable(Id pointer) const
{
    const auto argument = arguments_.find(pointer);
    return argument == arguments_.end() ? pointer : argument->second;
}

uint32_t Machine::evaluateRay(Instruction in)
{
    const auto ray = spirv::rayInstruction(in.opcode);
    if (!ray)
        throw std::runtime_error("opcode " + std::to_string(in.opcode));
    if (ray->onlyExecutes()) {
        seen_.push_back(kExecuted | hitObjectFlags_[variable(module_.word(in, ray->hitObject))]);
        return 0;
    }
    uint32_t flags = ray->query != 0 ? rayFlags_ : 0;
    if (ray->flags != 0) {
        flags = value(module_.word(in, ray->flags));
        seen_.push_back(kTraced | flags);
    }
    if (ray->hitObject != 0)
        hitObjectFlags_[variable(module_.word(in, ray->hitObject))] = flags;
    return 0;
}

} // namespace vellum::test
