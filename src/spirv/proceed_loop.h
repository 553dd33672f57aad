// SPDX-License-Identifier: Apache-2.0
// The usual loop around OpRayQueryProceedKHR, `while (proceed(q)) body`. Candidates that the rewritten module decides
// branch to the loop's continue target: with a loop inside the call, SIMD lanes would wait for each other.
#pragma once

#include "spirv/module/code.h"

#include <map>

namespace vellum::spirv
{

struct Block {
    Id label = 0;
    std::vector<Instruction> code;   // from OpLabel to the terminator
    std::vector<Instruction> behind; // generated blocks that follow
};

struct Function {
    std::vector<Instruction> head; // all instructions before the first block
    std::vector<Block> blocks;
    std::vector<Instruction> tail;              // OpFunctionEnd
    std::map<Id, size_t> indices;               // of blocks, by label
    std::map<Id, std::vector<Id>> predecessors; // labels by label
    bool flowKnown = true;                      // false if a terminator is unknown and predecessors are incomplete
};

// Splits the instructions of one function, OpFunction to OpFunctionEnd, into blocks.
Function splitFunction(const Module &module, std::span<const Instruction> code);

// Blocks of a loop whose continue target may be entered right after the proceed call.
struct ProceedLoop {
    size_t header = 0;
    size_t check = 0; // ends with the call and the branch on it; may be the header
    size_t next = 0;  // continue target: only branches back, unless it is the body
    Id body = 0;      // label of the branch target for a candidate
};

// Returns whether an entry point defines which invocations run an instruction together, as subgroup operations observe
// it. Those that find a candidate in the same call run the body together. With decisions in the loop they would not:
// the body runs for some while others are still at candidates that are decided.
bool definesConvergence(const Module &module);

// The loop whose condition is the proceed call at `call` in block `check`. Nothing if the loop has another shape, or if
// code between its continue target and the call must not run for a candidate that the application does not see.
std::optional<ProceedLoop> findProceedLoop(const Module &module, const Function &function, size_t check, size_t call);

// Puts a block between the call and the loop's body: runs `decision`, then branches to the continue target if its value
// `handled` is true.
void insertDecision(Module &module, Function &function, const ProceedLoop &loop, const Code &decision, Id handled);

} // namespace vellum::spirv
