// Rewrites the instructions of ray queries.
#pragma once

#include "spirv/candidate.h"
#include "spirv/proceed_loop.h"

#include <set>

namespace vellum::spirv
{

class RayQueries
{
public:
    RayQueries(Module &module, Types &types, Linker &linker, bool carriesFlagBits);

    // Rewrites all functions of the module. Returns whether anything changed; false with error() set on failure.
    bool rewrite();
    const std::string &error() const { return error_; }

private:
    static RayFlagMode findMode(const Module &module, const Types &types);
    bool rewriteFunction(std::span<const Instruction> code, std::vector<Instruction> &out);
    bool decideInLoop(Function &function, std::size_t block, std::size_t call);
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    bool initialize(Instruction in, Code &out);
    bool proceed(Instruction in, Code &out);
    bool getRayFlags(Instruction in, Code &out);
    bool getAabbOpaque(Instruction in, Code &out);

    Module &module_;
    Types &types_;
    Linker &linker_;
    RayFlagMode mode_;
    bool carriesFlagBits_;
    CandidateFunctions candidates_;
    std::set<Id> decidedInLoops_; // results of proceed calls that stay
    std::string error_;
};

} // namespace vellum::spirv
