// SPDX-License-Identifier: Apache-2.0
// A sequence of new instructions.
#pragma once

#include <cstdint>

#include "spirv/module/module.h"

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

} // namespace vellum::spirv
