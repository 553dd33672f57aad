// SPDX-License-Identifier: Apache-2.0
// Restores values that the driver returns and that differ from the application's.
#pragma once

#include <optional>
#include <set>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"
#include "spirv/side_variables.h"

namespace vellum::spirv
{

// Replaces an instruction, whose result is a 32-bit integer of either signedness, by a load from a pointer to a uint.
void loadUint(const Module &module, Types &types, Id pointer, Instruction in, Code &out);

// Passes the result of an instruction, a 32-bit integer, through `function`, which takes and returns a uint.
void restoreResult(Module &module, Types &types, Id function, Instruction in, Code &out);

// Reads of the built-in variables InstanceCustomIndex, where the driver has a slot, and IncomingRayFlags, where it has
// no hidden flags; and of the same properties of hit objects.
class BuiltIns
{
public:
    BuiltIns(Module &module, Types &types, Linker &linker, PayloadPrefix &prefix, SideVariables &hitObjects,
             const std::optional<PipelineStage> &stage);
    // Writes the replacement of an instruction to `out`. False if it is unchanged.
    bool replace(Instruction in, Code &out);
    // Returns whether an intersection shader reads ray flags whose hidden bits are in the payload, which it cannot
    // read. Call once other entry points are removed.
    [[nodiscard]] bool lacksHiddenFlags() const;

    // The Private variable for the application's custom index, which the prologue of an any-hit shader of triangles
    // gets from the lookup; 0 if nothing reads it.
    [[nodiscard]] Id knownIndex() const { return knownIndex_; }

private:
    enum class Restored { Nothing, CustomIndex, RayFlags };
    // The built-in that `pointer` points to.
    [[nodiscard]] Restored pointedTo(Id pointer) const;
    // Restores the result of an instruction. False if it is unchanged.
    bool restore(Instruction in, Restored what, Code &out);
    void readKnownIndex(Instruction in, Code &out);
    bool copy(Instruction in, Restored what, Code &out);
    bool restoreHitObjectFlags(Instruction in, Code &out);
    // Adds hidden flags, which are a uint, to the result.
    void addBits(Instruction in, Id bits, Code &out);

    Module &module_;
    Types &types_;
    Linker &linker_;
    PayloadPrefix &prefix_;
    SideVariables &hitObjects_;
    const std::optional<PipelineStage> &stage_;
    Id knownIndex_ = 0;
    std::set<Id> customIndex_;
    std::set<Id> incomingFlags_;
};

} // namespace vellum::spirv
