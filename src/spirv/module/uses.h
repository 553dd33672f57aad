// SPDX-License-Identifier: Apache-2.0
// Calls between the functions of a module, and uses of variables by instructions.
#pragma once

#include <map>
#include <set>
#include <vector>

#include "spirv/module/module.h"

namespace vellum::spirv
{

class CallGraph
{
public:
    explicit CallGraph(const Module &module);

    // Functions that a function calls.
    [[nodiscard]] const std::set<Id> &callees(Id function) const;
    // The functions, and all that they call, directly or through others.
    [[nodiscard]] std::set<Id> reachedFrom(std::vector<Id> functions) const;
    // The functions, and all that call them, directly or through others.
    [[nodiscard]] std::set<Id> reaching(std::vector<Id> functions) const;

private:
    using Neighbours = std::map<Id, std::set<Id>>;
    static std::set<Id> closure(const Neighbours &neighbours, std::vector<Id> functions);

    Neighbours callees_, callers_;
};

// Returns whether an instruction is debug information.
bool isDebug(const Module &module, Instruction in);

// The id that an id is a copy of: OpCopyObject, and access chains without indices, are followed.
Id copiedFrom(const Module &module, Id id);

// Returns whether one of the functions uses the pointer, which is a payload or hit attributes.
bool usesPointer(const Module &module, const std::set<Id> &functions, Id pointer);

} // namespace vellum::spirv
