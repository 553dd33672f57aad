#include "spirv/query_flags.h"

#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

// A chain of chains longer than this is a cycle in a malformed module.
constexpr int kMaxChain = 64;
// Ray queries nested deeper than this would need functions with more parameters than SPIR-V allows (2.17).
constexpr std::size_t kMaxIndices = 64;
constexpr int kMaxNesting = 64;

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

// The type with a uint in the place of each ray query; 0 if it has none. What is no query becomes a uint, too, so that
// the same indices lead through both.
Id QueryFlags::shapeOf(Id type, int depth)
{
    const Instruction in = module_.definition(type);
    if (in.opcode == spv::OpTypeRayQueryKHR)
        return types_.uint32();
    if ((in.opcode != spv::OpTypeArray && in.opcode != spv::OpTypeStruct) || depth > kMaxNesting)
        return 0;
    const auto [known, isNew] = shapes_.try_emplace(type, 0);
    if (!isNew)
        return known->second;
    std::vector<std::uint32_t> operands;
    if (in.opcode == spv::OpTypeArray) {
        const Id element = shapeOf(module_.word(in, 2), depth + 1);
        if (element != 0)
            operands = {element, module_.word(in, 3)};
    } else {
        bool any = false;
        for (std::uint32_t i = 2; i < in.count; ++i) {
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

// A new id for what lies beside a pointer of the type; nothing if it leads to no ray query.
std::optional<QueryFlags::Beside> QueryFlags::make(Id pointerType)
{
    const Instruction pointer = module_.definition(pointerType);
    if (pointer.opcode != spv::OpTypePointer)
        return {};
    const Id shape = shapeOf(module_.word(pointer, 3), 0);
    if (shape == 0)
        return {};
    return Beside{module_.newId(), types_.get(spv::OpTypePointer, {module_.word(pointer, 2), shape})};
}

QueryFlags::Beside QueryFlags::beside(Id variable) const
{
    const auto found = beside_.find(variable);
    return found == beside_.end() ? Beside{} : found->second;
}

Id QueryFlags::element(Beside beside, const std::vector<Id> &indices, Id type, Code &out)
{
    if (beside.id == 0 || indices.empty())
        return beside.id;
    const std::uint32_t storageClass = module_.word(module_.definition(beside.type), 2);
    std::vector<std::uint32_t> chain{beside.id};
    chain.insert(chain.end(), indices.begin(), indices.end());
    return out.value(spv::OpAccessChain, types_.get(spv::OpTypePointer, {storageClass, type}), std::move(chain));
}

Id QueryFlags::pointer(Id query, Code &out)
{
    const auto path = accessPath(module_, query);
    const Instruction type = module_.definition(module_.resultType(module_.definition(query)));
    const Id shape = type.opcode == spv::OpTypePointer ? shapeOf(module_.word(type, 3), 0) : 0;
    return path && shape != 0 ? element(beside(module_.result(path->base)), path->indices, shape, out) : 0;
}

bool QueryFlags::declare()
{
    inUse_ = true;
    std::vector<Id> variables;
    const std::vector<Instruction> globals = module_.section(Section::Globals);
    for (const Instruction in : globals) {
        if (in.opcode != spv::OpVariable)
            continue;
        if (const auto made = make(module_.word(in, 1))) {
            module_.append(Section::Globals, spv::OpVariable, {made->type, made->id, module_.word(in, 3)});
            beside_[module_.result(in)] = *made;
            variables.push_back(made->id);
        }
    }
    if (!module_.addToInterfaces(variables)) {
        error_ = kTooLongInterface;
        return false;
    }
    declareInFunctions();
    return error_.empty();
}

void QueryFlags::declareInFunctions()
{
    Code code(module_);
    const std::vector<Instruction> functions = module_.section(Section::Functions);
    for (const Instruction in : functions) {
        const bool isParameter = in.opcode == spv::OpFunctionParameter;
        if (in.opcode == spv::OpFunction)
            code.out.push_back(widenedFunction(in));
        else if (in.opcode == spv::OpFunctionCall)
            code.out.push_back(widenedCall(in, code));
        else
            code.out.push_back(in);
        if (!isParameter && in.opcode != spv::OpVariable)
            continue;
        if (const auto made = make(module_.word(in, 1))) {
            if (isParameter)
                code.put(spv::OpFunctionParameter, {made->type, made->id});
            else
                code.put(spv::OpVariable, {made->type, made->id, spv::StorageClassFunction});
            beside_[module_.result(in)] = *made;
        }
    }
    module_.section(Section::Functions) = std::move(code.out);
}

Instruction QueryFlags::widenedFunction(Instruction function)
{
    const Instruction type = module_.definition(module_.word(function, 4));
    if (type.opcode != spv::OpTypeFunction)
        return function;
    std::vector<Id> parameters;
    for (std::uint32_t i = 3; i < type.count; ++i) {
        parameters.push_back(module_.word(type, i));
        const Instruction pointer = module_.definition(parameters.back());
        const Id shape = pointer.opcode == spv::OpTypePointer ? shapeOf(module_.word(pointer, 3), 0) : 0;
        if (shape != 0)
            parameters.push_back(types_.get(spv::OpTypePointer, {module_.word(pointer, 2), shape}));
    }
    if (parameters.size() + 3 == type.count)
        return function;
    return module_.with(function, 4, types_.function(module_.word(type, 2), parameters));
}

Instruction QueryFlags::widenedCall(Instruction call, Code &out)
{
    std::vector<std::uint32_t> operands;
    bool changed = false;
    for (std::uint32_t i = 1; i < call.count; ++i) {
        const Id operand = module_.word(call, i);
        operands.push_back(operand);
        const Instruction type = module_.definition(module_.resultType(module_.definition(operand)));
        if (i < 4 || type.opcode != spv::OpTypePointer || shapeOf(module_.word(type, 3), 0) == 0)
            continue;
        const Id flags = pointer(operand, out);
        if (flags == 0)
            error_ = "it passes a function a ray query that is not reached through a variable or parameter";
        operands.push_back(flags);
        changed = true;
    }
    if (operands.size() + 1 > kMaxInstructionWords) {
        error_ = "a function call has too many arguments";
        return call;
    }
    return changed ? module_.make(spv::OpFunctionCall, operands) : call;
}

} // namespace vellum::spirv
