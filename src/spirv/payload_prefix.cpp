// SPDX-License-Identifier: Apache-2.0
#include "spirv/payload_prefix.h"

#include <algorithm>

#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"
#include "spirv/payload_types.h"

namespace vellum::spirv
{
namespace
{

// Members of struct {uint, T}.
constexpr uint32_t kPrefix = 0;
constexpr uint32_t kPayload = 1;

} // namespace

bool receivesPayload(uint32_t executionModel)
{
    return executionModel == spv::ExecutionModelAnyHitKHR || executionModel == spv::ExecutionModelClosestHitKHR ||
           executionModel == spv::ExecutionModelMissKHR;
}

bool PayloadPrefix::isPayload(uint32_t storageClass)
{
    return storageClass == spv::StorageClassRayPayloadKHR || storageClass == spv::StorageClassIncomingRayPayloadKHR;
}

Id PayloadPrefix::ownPayload(std::span<const uint32_t> payload)
{
    if (own_ == 0) {
        std::vector<uint32_t> members{types_.uint32()};
        if (const Id type = makeType(module_, types_, payload); type != 0)
            members.push_back(type);
        own_ = module_.newId();
        members.insert(members.begin(), own_);
        module_.append(Section::Globals, spv::OpTypeStruct, members);
    }
    return own_;
}

Id PayloadPrefix::keptFlags()
{
    if (kept_ == 0)
        kept_ = addPrivateVariable(module_, types_, types_.uint32());
    return kept_;
}

Id PayloadPrefix::pointer(Id variable, Code &out) const
{
    const auto found = payloads_.find(variable);
    if (found == payloads_.end())
        return 0;
    const uint32_t storageClass = module_.word(module_.definition(found->second), 2);
    return out.value(spv::OpAccessChain, types_.get(spv::OpTypePointer, {storageClass, types_.uint32()}),
                     {variable, types_.uintConstant(kPrefix)});
}

// The type of a pointer to the widened payload for one to the application's; 0 for other types. Appends new types to
// `globals`.
Id PayloadPrefix::widened(Id pointerType, std::vector<Instruction> &globals)
{
    const Instruction pointer = module_.definition(pointerType);
    if (pointer.opcode != spv::OpTypePointer || !isPayload(module_.word(pointer, 2)))
        return 0;
    Id &known = pointers_[pointerType];
    if (known != 0)
        return known;
    Id &payload = structs_[module_.word(pointer, 3)];
    if (payload == 0) {
        payload = module_.newId();
        globals.push_back(module_.make(spv::OpTypeStruct, {payload, types_.uint32(), module_.word(pointer, 3)}));
    }
    known = module_.newId();
    globals.push_back(module_.make(spv::OpTypePointer, {known, module_.word(pointer, 2), payload}));
    return known;
}

bool PayloadPrefix::widen()
{
    widenVariables();
    widenFunctions();
    return error_.empty();
}

// Widens variables in place, because debug information that names them may follow.
void PayloadPrefix::widenVariables()
{
    const Id uint = types_.uint32();
    auto &globals = module_.section(Section::Globals);
    // First, because all payloads need it.
    const auto declared = std::ranges::find_if(globals, [&](Instruction in) { return module_.result(in) == uint; });
    std::rotate(globals.begin(), declared, declared + 1);
    std::vector<Instruction> out;
    out.reserve(globals.size());
    for (const Instruction in : globals) {
        const Id type = in.opcode == spv::OpVariable ? widened(module_.word(in, 1), out) : 0;
        out.push_back(type != 0 ? module_.with(in, 1, type) : in);
        if (type != 0)
            payloads_[module_.result(in)] = module_.word(in, 1);
    }
    globals = std::move(out);
}

void PayloadPrefix::widenFunctions()
{
    Code code(module_);
    const std::vector<Instruction> functions = module_.section(Section::Functions);
    for (const Instruction in : functions) {
        if (in.opcode == spv::OpFunction) {
            function_ = module_.result(in);
            code.out.push_back(widenedFunction(in));
        } else if (in.opcode == spv::OpFunctionParameter) {
            const Id type = widened(module_.word(in, 1), module_.section(Section::Globals));
            code.out.push_back(type != 0 ? module_.with(in, 1, type) : in);
            if (type != 0)
                payloads_[module_.result(in)] = module_.word(in, 1);
        } else {
            code.out.push_back(throughPayload(in, code));
        }
    }
    module_.section(Section::Functions) = std::move(code.out);
}

Instruction PayloadPrefix::widenedFunction(Instruction function)
{
    const Instruction type = module_.definition(module_.word(function, 4));
    if (type.opcode != spv::OpTypeFunction)
        return function;
    std::vector<Id> parameters;
    bool changed = false;
    for (uint32_t i = 3; i < type.count; ++i) {
        const Id pointer = widened(module_.word(type, i), module_.section(Section::Globals));
        parameters.push_back(pointer != 0 ? pointer : module_.word(type, i));
        changed = changed || pointer != 0;
    }
    return changed ? module_.with(function, 4, types_.function(module_.word(type, 2), parameters)) : function;
}

// Errors in functions that the stage does not reach are ignored.
void PayloadPrefix::fail(const char *error)
{
    if (reached_.contains(function_))
        error_ = error;
}

// Makes an instruction of the application access its part of payloads.
Instruction PayloadPrefix::throughPayload(Instruction in, Code &out)
{
    // The instruction with the application's part in place of payloads among the words from `first` to `last`.
    const auto withParts = [&](uint32_t first, uint32_t last) {
        const Words words = module_.words(in);
        std::vector<uint32_t> operands(words.begin() + 1, words.end());
        bool changed = false;
        for (uint32_t i = first; i <= last && i <= operands.size(); ++i) {
            const auto found = payloads_.find(operands[i - 1]);
            if (found == payloads_.end())
                continue;
            operands[i - 1] =
                out.value(spv::OpAccessChain, found->second, {found->first, types_.uintConstant(kPayload)});
            changed = true;
        }
        return changed ? module_.make(in.opcode, operands) : in;
    };
    switch (in.opcode) {
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain: {
        if (!payloads_.contains(module_.word(in, 3)))
            return in;
        const Words words = module_.words(in);
        std::vector<uint32_t> operands(words.begin() + 1, words.end());
        if (operands.size() + 2 > kMaxInstructionWords) {
            fail("an access chain has too many indices");
            return in;
        }
        operands.insert(operands.begin() + 3, types_.uintConstant(kPayload));
        return module_.make(in.opcode, operands);
    }
    case spv::OpCopyObject:
        if (!payloads_.contains(module_.word(in, 3)))
            return in;
        return module_.make(spv::OpAccessChain, {module_.word(in, 1), module_.word(in, 2), module_.word(in, 3),
                                                 types_.uintConstant(kPayload)});
    case spv::OpExtInst: return isDebug(module_, in) ? in : withParts(5, in.count);
    // Functions get whole payloads with the prefix (SPIR-V, 2.16.1: a pointer argument is a memory object declaration).
    case spv::OpFunctionCall:
        for (uint32_t i = 4; i < in.count; ++i) {
            const Id argument = module_.word(in, i);
            const Instruction type = module_.definition(module_.resultType(module_.definition(argument)));
            if (type.opcode == spv::OpTypePointer && isPayload(module_.word(type, 2)) && !payloads_.contains(argument))
                fail("it passes a part of a ray payload to a function by a pointer");
        }
        return in;
    case spv::OpLoad: return withParts(3, 3);
    case spv::OpStore: return withParts(1, 1);
    case spv::OpCopyMemory:
    case spv::OpCopyMemorySized: return withParts(1, 2);
    default: return in;
    }
}

} // namespace vellum::spirv
