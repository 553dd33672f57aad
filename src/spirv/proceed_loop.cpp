// SPDX-License-Identifier: Apache-2.0
#include "spirv/proceed_loop.h"

#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"

#include <algorithm>

namespace vellum::spirv
{
namespace
{

constexpr uint32_t kFirstPair = 3; // word of OpPhi's first value; its block follows

// Limit of a header's phis and of edges into a continue target, to bound the time.
constexpr size_t kMaxEdges = 1000;

// Adds the labels that a terminator branches to. False if it is unknown.
bool successors(const Module &module, Instruction in, std::vector<Id> &out)
{
    switch (in.opcode) {
    case spv::OpBranch: out.push_back(module.word(in, 1)); return true;
    case spv::OpBranchConditional:
        out.push_back(module.word(in, 2));
        out.push_back(module.word(in, 3));
        return true;
    case spv::OpSwitch: {
        const Instruction selector = module.definition(module.word(in, 1));
        const Instruction type = module.definition(module.resultType(selector));
        if (type.opcode != spv::OpTypeInt)
            return false;
        out.push_back(module.word(in, 2));
        const uint32_t literal = module.word(type, 2) > 32 ? 2 : 1;
        for (uint32_t i = 3 + literal; i < in.count; i += literal + 1)
            out.push_back(module.word(in, i));
        return true;
    }
    case spv::OpReturn:
    case spv::OpReturnValue:
    case spv::OpKill:
    case spv::OpUnreachable:
    case spv::OpTerminateInvocation:
    case spv::OpIgnoreIntersectionKHR:
    case spv::OpTerminateRayKHR: return true;
    default: return false;
    }
}

// Returns whether an instruction may run again, without the application's code in between, and change nothing.
bool isRepeatable(const Module &module, Instruction in)
{
    switch (in.opcode) {
    case spv::OpLoad: return (module.word(in, 4) & spv::MemoryAccessVolatileMask) == 0;
    case spv::OpUndef:
    case spv::OpPhi:
    case spv::OpSelect:
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpCopyObject:
    case spv::OpCopyLogical: return true;
    default: break;
    }
    const auto within = [&](uint32_t first, uint32_t last) { return in.opcode >= first && in.opcode <= last; };
    return isDebug(module, in) || within(spv::OpVectorExtractDynamic, spv::OpTranspose) ||
           within(spv::OpConvertFToU, spv::OpFUnordGreaterThanEqual) ||
           within(spv::OpShiftRightLogical, spv::OpBitCount);
}

// Returns whether this holds for all instructions of a block after the label, up to `end`.
bool allRepeatable(const Module &module, const Block &block, size_t end)
{
    return std::all_of(block.code.begin() + 1, block.code.begin() + static_cast<ptrdiff_t>(end),
                       [&](Instruction in) { return isRepeatable(module, in); });
}

// The value that a phi has on the edge from a block; 0 if it has none.
Id valueFrom(const Module &module, Instruction phi, Id label)
{
    for (uint32_t i = kFirstPair; i + 1 < phi.count; i += 2)
        if (module.word(phi, i + 1) == label)
            return module.word(phi, i);
    return 0;
}

// Returns whether insertDecision() can find values of the header's and continue target's phis for the new edge.
bool phisAllowEdge(const Module &module, const Block &header, const Block &next, bool bodyIsNext)
{
    std::vector<Id> carried;
    for (const Instruction in : header.code) {
        if (in.opcode != spv::OpPhi)
            continue;
        carried.push_back(valueFrom(module, in, next.label));
        if (carried.back() == 0 || carried.size() > kMaxEdges)
            return false;
    }
    // A phi of the continue target gets one more value, so two phis of the header cannot share it.
    return bodyIsNext || std::ranges::all_of(next.code, [&](Instruction in) {
               return in.opcode != spv::OpPhi ||
                      (in.count < 2 * kMaxEdges && std::ranges::count(carried, module.result(in)) == 1);
           });
}

// Returns whether debug information is about ids that are defined outside of functions. Values of the loop's body need
// not be defined on the new edge.
bool usesGlobalsOnly(const Module &module, Instruction in)
{
    constexpr uint32_t kOperands = 5; // word of the first operand of OpExtInst
    const Words words = module.words(in);
    return in.opcode != spv::OpExtInst ||
           std::all_of(words.begin() + kOperands, words.end(), [&](Id operand) { return module.isGlobal(operand); });
}

// A decided candidate must run nothing in the continue target except the branch to the header. If the loop's body is
// the continue target (optimizers merge them), a new continue target is added after it.
bool nextAllowsEdge(const Module &module, const Function &function, const ProceedLoop &loop)
{
    const Block &next = function.blocks[loop.next];
    const auto edges = function.predecessors.find(next.label);
    const size_t edgeCount = edges == function.predecessors.end() ? 0 : edges->second.size();
    if (loop.body == next.label)
        return edgeCount == 1;
    return edgeCount < kMaxEdges && std::all_of(next.code.begin() + 1, next.code.end() - 1, [&](Instruction in) {
               return in.opcode == spv::OpPhi || (isDebug(module, in) && usesGlobalsOnly(module, in));
           });
}

} // namespace

bool definesConvergence(const Module &module)
{
    return std::ranges::any_of(module.section(Section::ExecutionModes), [&](Instruction in) {
        const uint32_t mode = module.word(in, 2);
        return in.opcode == spv::OpExecutionMode && (mode == spv::ExecutionModeSubgroupUniformControlFlowKHR ||
                                                     mode == spv::ExecutionModeMaximallyReconvergesKHR);
    });
}

Function splitFunction(const Module &module, std::span<const Instruction> code)
{
    Function f;
    for (const Instruction in : code) {
        if (in.opcode == spv::OpLabel) {
            f.indices[module.word(in, 1)] = f.blocks.size();
            f.blocks.push_back({.label = module.word(in, 1), .code = {in}, .behind = {}});
        } else if (in.opcode == spv::OpFunctionEnd)
            f.tail.push_back(in);
        else
            (f.blocks.empty() ? f.head : f.blocks.back().code).push_back(in);
    }
    for (const Block &block : f.blocks) {
        std::vector<Id> to;
        f.flowKnown = successors(module, block.code.back(), to) && f.flowKnown;
        std::ranges::sort(to);
        to.erase(std::unique(to.begin(), to.end()), to.end());
        for (const Id label : to)
            f.predecessors[label].push_back(block.label);
    }
    return f;
}

std::optional<ProceedLoop> findProceedLoop(const Module &module, const Function &function, size_t checkIndex,
                                           size_t call)
{
    const auto indexOf = [&](Id label) {
        const auto it = function.indices.find(label);
        return it == function.indices.end() ? function.blocks.size() : it->second;
    };
    const Block &check = function.blocks[checkIndex];
    const Instruction branch = check.code.back();
    if (!function.flowKnown || branch.opcode != spv::OpBranchConditional ||
        module.word(branch, 1) != module.result(check.code[call]))
        return {};

    ProceedLoop loop{.check = checkIndex};
    const bool merged = check.code[check.code.size() - 2].opcode == spv::OpLoopMerge;
    if (merged) {
        loop.header = checkIndex;
    } else {
        const auto before = function.predecessors.find(check.label);
        if (before == function.predecessors.end() || before->second.size() != 1)
            return {};
        loop.header = indexOf(before->second[0]);
        if (loop.header == function.blocks.size()) // a block of insertDecision()
            return {};
    }
    const Block &header = function.blocks[loop.header];
    if (header.code.size() < 3 || (!merged && header.code.back().opcode != spv::OpBranch))
        return {};
    const Instruction merge = header.code[header.code.size() - 2];
    if (merge.opcode != spv::OpLoopMerge)
        return {};
    // Other loop controls are promises about the number of iterations or about dependencies.
    const uint32_t harmless = spv::LoopControlUnrollMask | spv::LoopControlDontUnrollMask;
    if ((module.word(merge, 3) & ~harmless) != 0)
        return {};

    loop.body = module.word(branch, 2);
    loop.next = indexOf(module.word(merge, 2));
    if (module.word(branch, 3) != module.word(merge, 1) || loop.body == module.word(merge, 1) ||
        loop.body == header.label || indexOf(loop.body) == function.blocks.size() ||
        loop.next == function.blocks.size() || loop.next == loop.header || loop.next == loop.check)
        return {};

    const Block &next = function.blocks[loop.next];
    if (next.code.back().opcode != spv::OpBranch || module.word(next.code.back(), 1) != header.label)
        return {};
    if (!nextAllowsEdge(module, function, loop) || !phisAllowEdge(module, header, next, loop.body == next.label))
        return {};

    // Only the merge instruction may be between the call and the branch.
    const size_t end = check.code.size() - (merged ? 2 : 1);
    if (!std::all_of(check.code.begin() + static_cast<ptrdiff_t>(call) + 1,
                     check.code.begin() + static_cast<ptrdiff_t>(end),
                     [&](Instruction in) { return isDebug(module, in); }))
        return {};
    if (!allRepeatable(module, check, call) || (!merged && !allRepeatable(module, header, header.code.size() - 2)))
        return {};
    return loop;
}

void insertDecision(Module &module, Function &function, const ProceedLoop &loop, const Code &decision, Id handled)
{
    Block &header = function.blocks[loop.header];
    Block &check = function.blocks[loop.check];
    Block &next = function.blocks[loop.next];
    const Id label = module.newId();
    const bool bodyIsNext = loop.body == next.label;
    const Id target = bodyIsNext ? module.newId() : next.label; // the continue target from now on

    // The new edge changes nothing: the header's phis keep their values.
    std::vector<Id> edges{next.label};
    if (!bodyIsNext)
        edges = function.predecessors[next.label];
    std::vector<Instruction> phis;
    for (const Instruction phi : header.code) {
        if (phi.opcode != spv::OpPhi)
            continue;
        const Id result = module.result(phi);
        Id value = valueFrom(module, phi, next.label);
        const auto own = std::ranges::find_if(next.code, [&](Instruction in) {
            return !bodyIsNext && in.opcode == spv::OpPhi && module.result(in) == value;
        });
        if (own != next.code.end()) {
            const Words w = module.words(*own);
            std::vector<uint32_t> operands(w.begin() + 1, w.end());
            operands.insert(operands.end(), {result, label});
            *own = module.make(spv::OpPhi, operands);
        } else if (value != result) {
            std::vector<uint32_t> operands{module.resultType(phi), module.newId()};
            for (const Id from : edges)
                operands.insert(operands.end(), {value, from});
            operands.insert(operands.end(), {result, label});
            phis.push_back(module.make(spv::OpPhi, operands));
            value = operands[1];
        }
        for (uint32_t i = kFirstPair; i + 1 < phi.count; i += 2)
            if (module.word(phi, i + 1) == next.label) {
                module.set(phi, i, value);
                module.set(phi, i + 1, target);
            }
    }
    if (bodyIsNext) {
        Instruction &merge = header.code[header.code.size() - 2];
        merge = module.with(merge, 2, target);
        next.behind.push_back(module.make(spv::OpLabel, {target}));
        next.behind.insert(next.behind.end(), phis.begin(), phis.end());
        next.behind.push_back(next.code.back());
        next.code.back() = module.make(spv::OpBranch, {target});
    } else {
        next.code.insert(next.code.begin() + 1, phis.begin(), phis.end());
    }

    check.code.back() = module.with(check.code.back(), 2, label);
    check.behind.push_back(module.make(spv::OpLabel, {label}));
    check.behind.insert(check.behind.end(), decision.out.begin(), decision.out.end());
    check.behind.push_back(module.make(spv::OpBranchConditional, {handled, target, loop.body}));

    for (const Instruction phi : function.blocks[function.indices[loop.body]].code)
        for (uint32_t i = kFirstPair; phi.opcode == spv::OpPhi && i + 1 < phi.count; i += 2)
            if (module.word(phi, i + 1) == check.label)
                module.set(phi, i + 1, label);
    std::ranges::replace(function.predecessors[loop.body], check.label, label);
    function.predecessors[target].push_back(label);
    if (bodyIsNext) {
        function.predecessors[target].push_back(next.label);
        std::ranges::replace(function.predecessors[header.label], next.label, target);
    }
}

} // namespace vellum::spirv
