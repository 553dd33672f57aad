// SPDX-License-Identifier: Apache-2.0
// Finds types and constants in a module, or adds them.
#pragma once

#include "spirv/module/module.h"

#include <cstdint>
#include <map>

namespace vellum::spirv
{

class Types
{
public:
    explicit Types(Module &module);

    // The id of the type or constant with this opcode and these operands (without the result id; for constants the type
    // comes first). Two equal non-aggregate types are not allowed in a module (SPIR-V specification, 2.8), so what the
    // application has must be found. Not for aggregates.
    Id get(uint32_t opcode, std::vector<uint32_t> operands);

    Id none(); // OpTypeVoid
    Id boolean();
    Id uint32();
    Id float32();
    Id float32x2();
    Id function(Id returnType, const std::vector<Id> &parameters);
    Id uintConstant(uint32_t value);
    Id constantTrue();

    // The value of a 32-bit OpConstant of integer type or OpConstantNull; nothing for all else. Specialization
    // constants are all else: the application may still change them.
    std::optional<uint32_t> valueOf(Id id) const;

    // Returns whether `get` can look up such an instruction.
    static bool isUnique(uint32_t opcode);

private:
    Module &module_;
    std::map<std::vector<uint32_t>, Id> known_;
};

// Adds a module-scope variable of storage class Private.
Id addPrivateVariable(Module &module, Types &types, Id type);

} // namespace vellum::spirv
