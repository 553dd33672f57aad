// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/types.h"

#include "spirv/module/numbers.h"

namespace vellum::spirv
{

bool Types::isUnique(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTypeVoid:
    case spv::OpTypeBool:
    case spv::OpTypeInt:
    case spv::OpTypeFloat:
    case spv::OpTypeVector:
    case spv::OpTypePointer:
    case spv::OpTypeFunction:
    case spv::OpConstantTrue:
    case spv::OpConstantFalse:
    case spv::OpConstant: return true;
    default: return false;
    }
}

Types::Types(Module &module) : module_(module)
{
    for (const Instruction in : module.section(Section::Globals)) {
        if (!isUnique(in.opcode))
            continue;
        const Id id = module.result(in);
        std::vector<uint32_t> key{in.opcode};
        for (uint32_t i = 1; i < in.count; ++i)
            if (i != (module.resultType(in) != 0 ? 2u : 1u))
                key.push_back(module.word(in, i));
        known_.emplace(std::move(key), id); // the first of equals
    }
}

Id Types::get(uint32_t opcode, std::vector<uint32_t> operands)
{
    std::vector<uint32_t> key{opcode};
    key.insert(key.end(), operands.begin(), operands.end());
    const auto [it, added] = known_.emplace(std::move(key), 0);
    if (added) {
        it->second = module_.newId();
        const bool isConstant = opcode >= spv::OpConstantTrue;
        operands.insert(operands.begin() + (isConstant ? 1 : 0), it->second);
        module_.append(Section::Globals, opcode, operands);
    }
    return it->second;
}

Id Types::none()
{
    return get(spv::OpTypeVoid, {});
}

Id Types::boolean()
{
    return get(spv::OpTypeBool, {});
}

Id Types::uint32()
{
    return get(spv::OpTypeInt, {32, 0});
}

Id Types::float32()
{
    return get(spv::OpTypeFloat, {32});
}

Id Types::float32x2()
{
    return get(spv::OpTypeVector, {float32(), 2});
}

Id Types::function(Id returnType, const std::vector<Id> &parameters)
{
    std::vector<uint32_t> operands{returnType};
    operands.insert(operands.end(), parameters.begin(), parameters.end());
    return get(spv::OpTypeFunction, std::move(operands));
}

Id Types::uintConstant(uint32_t value)
{
    return get(spv::OpConstant, {uint32(), value});
}

Id Types::constantTrue()
{
    return get(spv::OpConstantTrue, {boolean()});
}

std::optional<uint32_t> Types::valueOf(Id id) const
{
    const Instruction in = module_.definition(id);
    const Instruction type = module_.definition(module_.word(in, 1));
    if (type.opcode != spv::OpTypeInt || module_.word(type, 2) != 32 || !module_.isGlobal(id))
        return {};
    if (in.opcode == spv::OpConstantNull)
        return 0;
    if (in.opcode == spv::OpConstant)
        return module_.word(in, 3);
    return {};
}

Id addPrivateVariable(Module &module, Types &types, Id type)
{
    const Id pointer = types.get(spv::OpTypePointer, {spv::StorageClassPrivate, type});
    const Id variable = module.newId();
    module.append(Section::Globals, spv::OpVariable, {pointer, variable, spv::StorageClassPrivate});
    return variable;
}

} // namespace vellum::spirv
