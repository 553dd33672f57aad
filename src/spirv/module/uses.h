// SPDX-License-Identifier: Apache-2.0
// Uses of variables by instructions.
#pragma once

#include <set>

#include "spirv/module/module.h"

namespace vellum::spirv
{

// Whether an instruction is debug information.
bool isDebug(const Module &module, Instruction in);

// What an id is a copy of: OpCopyObject, and access chains without indices, are followed.
Id copiedFrom(const Module &module, Id id);

// Whether one of the functions uses the pointer, which is a payload or hit attributes.
bool usesPointer(const Module &module, const std::set<Id> &functions, Id pointer);

} // namespace vellum::spirv
