// SPDX-License-Identifier: Apache-2.0
// Sequences of new instructions.
#pragma once

#include <cstdint>

#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
#include "spirv/module/types.h"

namespace vellum::spirv
{

class Code
{
public:
    explicit Code(Module &module) : module_(module) {}

    // An instruction without a result, or with its result among the operands.
    void put(uint32_t opcode, std::vector<uint32_t> operands) { out.push_back(module_.make(opcode, operands)); }
    // An instruction with a result of the given type. Returns the new id.
    Id value(uint32_t opcode, Id type, std::vector<uint32_t> operands)
    {
        const Id id = module_.newId();
        operands.insert(operands.begin(), {type, id});
        put(opcode, std::move(operands));
        return id;
    }

    std::vector<Instruction> out;

private:
    Module &module_;
};

// --- 32-bit integers of the application, which may be signed. The rewriter's own are uints. ---

// A value as a uint. The type of an unknown instruction's result is unknown (0); a cast to the same type is harmless.
inline Id toUint(Types &types, Id type, Id value, Code &out)
{
    const Id uint = types.uint32();
    return type == uint ? value : out.value(spv::OpBitcast, uint, {value});
}

// The bits of a value of either signedness that are in `mask`, as a uint: a constant if the value is one.
inline Id maskBits(Types &types, Id value, uint32_t mask, Code &out)
{
    if (const auto constant = types.valueOf(value))
        return types.uintConstant(*constant & mask);
    return out.value(spv::OpBitwiseAnd, types.uint32(), {value, types.uintConstant(mask)});
}

// Tests whether a uint has any of these bits.
inline Id hasBits(Types &types, Id value, uint32_t bits, Code &out)
{
    const Id masked = out.value(spv::OpBitwiseAnd, types.uint32(), {value, types.uintConstant(bits)});
    return out.value(spv::OpINotEqual, types.boolean(), {masked, types.uintConstant(0)});
}

// An instruction that makes a uint, for the result of one that makes an integer of the given type.
inline void putUint(Types &types, Id type, Id result, uint32_t opcode, std::vector<uint32_t> operands, Code &out)
{
    const Id uint = types.uint32();
    if (type == uint) {
        operands.insert(operands.begin(), {type, result});
        out.put(opcode, std::move(operands));
    } else {
        out.put(spv::OpBitcast, {type, result, out.value(opcode, uint, std::move(operands))});
    }
}

} // namespace vellum::spirv
