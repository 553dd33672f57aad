// SPDX-License-Identifier: Apache-2.0
// Rewrites the instructions of ray queries.
#pragma once

#include "spirv/candidate.h"
#include "spirv/consumption.h"
#include "spirv/proceed_loop.h"

#include <set>

namespace vellum::spirv
{

struct RayQueryOptions {
    const std::set<Id> &reached; // the functions of the entry points that are kept
    bool constantFlags = true;   // flags that are the same everywhere become constants
    bool force2State = true;     // the module declares the capability of the ray flag ForceOpacityMicromap2State
};

class RayQueries
{
public:
    // `hitObjects`: the side variables for their hidden flags, if any.
    RayQueries(Module &module, Types &types, Linker &linker, Consumption &consumption, SideVariables &hitObjects,
               RayQueryOptions options);

    // Rewrites all functions of the module. Returns whether anything changed; false with error() set on failure.
    bool rewrite();
    const std::string &error() const { return error_; }

private:
    [[nodiscard]] RayFlagMode findMode() const;
    bool rewriteFunction(std::span<const Instruction> code, std::vector<Instruction> &out);
    bool decideInLoop(Function &function, size_t block, size_t call);
    // Writes the replacement of an instruction to `out`. False if it is unchanged.
    bool replace(Instruction in, Code &out);
    bool initialize(Instruction in, Code &out);
    // Store and load the application's flags in the side variable of a query.
    bool keepFlags(Instruction in, Code &out);
    void keepInHitObject(Instruction in, Code &out);
    bool getKeptFlags(Instruction in, Code &out);
    bool proceed(Instruction in, Code &out);
    bool getRayFlags(Instruction in, Code &out);
    void getCustomIndex(Instruction in, Code &out);
    bool getAabbOpaque(Instruction in, Code &out);
    // Some flags are not constant, and need side variables.
    [[nodiscard]] bool travel() const;
    // The driver's ray flags if the query consumes micromaps, and if it does not.
    Id consumingFlags(Id flags, Code &out);
    Id idleFlags(Id flags, Code &out);
    // Selects a value by whether the function consumes micromaps, which may be a condition.
    Id choose(Id type, Id consuming, Id idle, Code &out);

    Module &module_;
    Types &types_;
    Linker &linker_;
    const std::set<Id> &reached_;
    Consumption &consumption_;
    SideVariables &hitObjects_;
    RayQueryOptions options_;
    bool definesConvergence_;
    RayFlagMode mode_;
    SideVariables queryFlags_;
    CandidateIndices indices_;
    Id function_ = 0;   // the function that is being rewritten
    Consumes consumes_; // of that function
    CandidateFunctions candidates_;
    std::set<Id> decidedInLoops_; // results of proceed calls that are unchanged
    std::string error_;
};

} // namespace vellum::spirv
