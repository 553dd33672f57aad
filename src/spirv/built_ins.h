// What the driver returns is not always what the application is to see: restores it.
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

// A load of a 32-bit integer from a pointer to a uint in place of an instruction with a result of either signedness.
void loadUint(const Module &module, Types &types, Id pointer, Instruction in, Code &out);

// An instruction whose result, a 32-bit integer, goes through `function`, which takes and returns a uint.
void restoreResult(Module &module, Types &types, Id function, Instruction in, Code &out);

// Reads of built-in variables: InstanceCustomIndex, which is a slot, and IncomingRayFlags, which lacks
// hidden flags. Also the same of hit objects.
class BuiltIns
{
public:
    BuiltIns(Module &module, Types &types, Linker &linker, PayloadPrefix &prefix, SideVariables &hitObjects,
             const std::optional<PipelineStage> &stage);
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // An intersection shader reads ray flags, and their hidden bits are where it cannot see them. After its entry point
    // was selected.
    [[nodiscard]] bool lacksHiddenFlags() const;

    // A Private variable with the application's custom index, which the code in front of an any-hit shader of triangles
    // finds when it looks the hit up; 0 where nothing reads it.
    [[nodiscard]] Id knownIndex() const { return knownIndex_; }

private:
    enum class Restored { Nothing, CustomIndex, RayFlags };
    // What `pointer` points to.
    [[nodiscard]] Restored pointedTo(Id pointer) const;
    // An instruction whose result is restored. False if it stays as it is.
    bool restore(Instruction in, Restored what, Code &out);
    void readKnownIndex(Instruction in, Code &out);
    bool copy(Instruction in, Restored what, Code &out);
    bool restoreHitObjectFlags(Instruction in, Code &out);
    // The flags with the hidden ones, which are a uint.
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
