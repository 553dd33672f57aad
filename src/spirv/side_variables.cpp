// SPDX-License-Identifier: Apache-2.0
#include "spirv/side_variables.h"

#include "spirv/module/numbers.h"

namespace vellum::spirv
{
namespace
{

// A chain of chains longer than this is a cycle in a malformed module.
constexpr int kMaxChain = 64;
// Objects nested deeper than this would need functions with more parameters than SPIR-V allows (2.17).
constexpr size_t kMaxIndices = 64;
constexpr int kMaxTypeNesting = 64;

} // namespace

std::optional<AccessPath> accessPath(const Module &module, Id pointer)
{
    AccessPath path;
    path.base = module.definition(pointer);
    for (int i = 0; i < kMaxChain; ++i, path.base = module.definition(module.word(path.base, 3))) {
        if (path.base.opcode == spv::OpCopyObject)
            continue;
        if (path.base.opcode != spv::OpAccessChain && path.base.opcode != spv::OpInBoundsAccessChain)
            break;
        const Words w = module.words(path.base);
        if (path.indices.size() + w.size() > kMaxIndices)
            return {};
        path.indices.insert(path.indices.begin(), w.begin() + 4, w.end());
    }
    if (path.base.opcode != spv::OpVariable && path.base.opcode != spv::OpFunctionParameter)
        return {};
    return path;
}

bool SideVariables::isObject(uint32_t type) const
{
    return objects_ == Beside::RayQueries ? type == spv::OpTypeRayQueryKHR
                                          : type == spv::OpTypeHitObjectNV || type == spv::OpTypeHitObjectEXT;
}

// The type with a uint in place of each object; 0 if it has none. Other members also become a uint, so that the same
// indices are valid in both.
Id SideVariables::shapeOf(Id type, int depth)
{
    const Instruction in = module_.definition(type);
    if (isObject(in.opcode))
        return types_.uint32();
    if ((in.opcode != spv::OpTypeArray && in.opcode != spv::OpTypeStruct) || depth > kMaxTypeNesting)
        return 0;
    const auto [known, isNew] = shapes_.try_emplace(type, 0);
    if (!isNew)
        return known->second;
    std::vector<uint32_t> operands;
    if (in.opcode == spv::OpTypeArray) {
        const Id element = shapeOf(module_.word(in, 2), depth + 1);
        if (element != 0)
            operands = {element, module_.word(in, 3)};
    } else {
        bool any = false;
        for (uint32_t i = 2; i < in.count; ++i) {
            const Id member = shapeOf(module_.word(in, i), depth + 1);
            any = any || member != 0;
            operands.push_back(member != 0 ? member : types_.uint32());
        }
        if (!any)
            operands.clear();
    }
    if (operands.empty())
        return 0;
    const Id shape = module_.newId();
    operands.insert(operands.begin(), shape);
    module_.append(Section::Globals, in.opcode, operands);
    shapes_[type] = shape;
    return shape;
}

// The shape of the type that a pointer type points to; 0 for other types.
Id SideVariables::shapeOfPointee(Instruction pointerType)
{
    return pointerType.opcode == spv::OpTypePointer ? shapeOf(module_.word(pointerType, 3), 0) : 0;
}

// Makes the side variable of a variable or parameter, if it needs one.
std::optional<SideVariables::Variable> SideVariables::make(Instruction variable, const std::set<Id> *only)
{
    const Instruction pointer = module_.definition(module_.word(variable, 1));
    const Id shape = only && !only->contains(module_.result(variable)) ? 0 : shapeOfPointee(pointer);
    if (shape == 0)
        return {};
    const Variable made{module_.newId(), types_.get(spv::OpTypePointer, {module_.word(pointer, 2), shape})};
    beside_[module_.result(variable)] = made;
    return made;
}

SideVariables::Variable SideVariables::beside(Id variable) const
{
    const auto found = beside_.find(variable);
    return found == beside_.end() ? Variable{} : found->second;
}

Id SideVariables::element(Variable beside, const std::vector<Id> &indices, Id type, Code &out)
{
    if (beside.id == 0 || indices.empty())
        return beside.id;
    const uint32_t storageClass = module_.word(module_.definition(beside.type), 2);
    std::vector<uint32_t> chain{beside.id};
    chain.insert(chain.end(), indices.begin(), indices.end());
    return out.value(spv::OpAccessChain, types_.get(spv::OpTypePointer, {storageClass, type}), std::move(chain));
}

Id SideVariables::pointer(Id object, Code &out)
{
    const auto path = accessPath(module_, object);
    const Id shape = shapeOfPointee(module_.definition(module_.resultType(module_.definition(object))));
    return path && shape != 0 ? element(beside(module_.result(path->base)), path->indices, shape, out) : 0;
}

bool SideVariables::declare()
{
    return declareBeside(nullptr);
}

bool SideVariables::declare(const std::set<Id> &variables)
{
    return declareBeside(&variables);
}

bool SideVariables::declareBeside(const std::set<Id> *only)
{
    inUse_ = true;
    std::vector<Id> variables;
    const std::vector<Instruction> globals = module_.section(Section::Globals);
    for (const Instruction in : globals) {
        if (in.opcode != spv::OpVariable)
            continue;
        if (const auto made = make(in, only)) {
            module_.append(Section::Globals, spv::OpVariable, {made->type, made->id, module_.word(in, 3)});
            variables.push_back(made->id);
        }
    }
    if (!module_.addToInterfaces(variables)) {
        error_ = kTooLongInterface;
        return false;
    }
    Code code(module_);
    const std::vector<Instruction> functions = module_.section(Section::Functions);
    for (const Instruction in : functions) {
        if (in.opcode == spv::OpFunction && !only)
            code.out.push_back(widenedFunction(in));
        else if (in.opcode == spv::OpFunctionCall && !only)
            code.out.push_back(widenedCall(in, code));
        else
            code.out.push_back(in);
        const bool isParameter = in.opcode == spv::OpFunctionParameter;
        if (!isParameter && in.opcode != spv::OpVariable)
            continue;
        const auto made = make(in, only);
        if (made && isParameter)
            code.put(spv::OpFunctionParameter, {made->type, made->id});
        else if (made)
            code.put(spv::OpVariable, {made->type, made->id, spv::StorageClassFunction});
    }
    module_.section(Section::Functions) = std::move(code.out);
    return error_.empty();
}

Instruction SideVariables::widenedFunction(Instruction function)
{
    const Instruction type = module_.definition(module_.word(function, 4));
    if (type.opcode != spv::OpTypeFunction)
        return function;
    std::vector<Id> parameters;
    for (uint32_t i = 3; i < type.count; ++i) {
        parameters.push_back(module_.word(type, i));
        const Instruction pointer = module_.definition(parameters.back());
        if (const Id shape = shapeOfPointee(pointer); shape != 0)
            parameters.push_back(types_.get(spv::OpTypePointer, {module_.word(pointer, 2), shape}));
    }
    if (parameters.size() + 3 == type.count)
        return function;
    return module_.with(function, 4, types_.function(module_.word(type, 2), parameters));
}

Instruction SideVariables::widenedCall(Instruction call, Code &out)
{
    std::vector<uint32_t> operands;
    bool changed = false;
    for (uint32_t i = 1; i < call.count; ++i) {
        const Id operand = module_.word(call, i);
        operands.push_back(operand);
        if (i < 4 || shapeOfPointee(module_.definition(module_.resultType(module_.definition(operand)))) == 0)
            continue;
        const Id besideIt = pointer(operand, out);
        if (besideIt == 0)
            error_ = std::string("it passes a function a ") +
                     (objects_ == Beside::RayQueries ? "ray query" : "hit object") +
                     " that is not reached through a variable or parameter";
        operands.push_back(besideIt);
        changed = true;
    }
    if (operands.size() + 1 > kMaxInstructionWords) {
        error_ = "a function call has too many arguments";
        return call;
    }
    return changed ? module_.make(spv::OpFunctionCall, operands) : call;
}

} // namespace vellum::spirv
