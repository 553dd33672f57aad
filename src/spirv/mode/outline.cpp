// SPDX-License-Identifier: Apache-2.0
#include "spirv/mode/outline.h"

#include <array>

#include "spirv/module/numbers.h"

namespace vellum::spirv
{
namespace
{

Op opOf(Words in)
{
    return static_cast<Op>(opcodeOf(in));
}

bool tracesRay(uint32_t opcode)
{
    switch (opcode) {
    case static_cast<uint32_t>(Op::TraceRayKHR):
    case kOpTraceRayMotionNV:
    case kOpHitObjectTraceRayNV:
    case kOpHitObjectTraceRayMotionNV:
    case kOpHitObjectTraceRayEXT:
    case kOpHitObjectTraceRayMotionEXT:
    case kOpHitObjectTraceReorderExecuteEXT:
    case kOpHitObjectTraceMotionReorderExecuteEXT: return true;
    default: return false;
    }
}

// The number of words up to the last operand that is read.
size_t leastWords(Op op)
{
    switch (op) {
    case Op::Capability:
    case Op::Extension:
    case Op::TypeBool: return 2;
    case Op::ExecutionMode:
    case Op::ExecutionModeId:
    case Op::ConstantTrue:
    case Op::ConstantFalse:
    case Op::ConstantNull:
    case Op::SpecConstantTrue:
    case Op::SpecConstantFalse:
    case Op::SpecConstantOp:
    case Op::Function:
    case Op::Decorate: return 3;
    case Op::EntryPoint:
    case Op::FunctionCall: return 4;
    default: return 1;
    }
}

// Reads the instructions in their order.
class Reader
{
public:
    explicit Reader(Words words) : words_(words) {}

    std::optional<Outline> read(std::string &error)
    {
        if (!isSpirv(words_)) {
            error = "not a SPIR-V module of this machine's byte order";
            return {};
        }
        const size_t end = visitInstructions(words_, [this](Words in) { return visit(in); });
        if (end != words_.size()) {
            error = "the instruction at word " + std::to_string(end) + " is incomplete";
            return {};
        }
        if (function_ == 0)
            outline_.globals = globalsEnd_;
        finishPositions();
        return std::move(outline_);
    }

private:
    bool visit(Words in)
    {
        const Op op = opOf(in);
        if (in.size() < leastWords(op))
            return false;
        const auto next = static_cast<size_t>(in.data() - words_.data()) + in.size();
        if (function_ == 0 && op != Op::Function)
            declaration(op, in, next);
        else
            code(op, in);
        return true;
    }

    void declaration(Op op, Words in, size_t next)
    {
        // OpLine before the first function belongs to the function.
        if (op != Op::Line && op != Op::NoLine)
            globalsEnd_ = next;
        switch (op) {
        case Op::Capability:
            outline_.hasModeCapability = outline_.hasModeCapability || in[1] == kCapabilityOpacityMicromapExecutionMode;
            outline_.hasFlagCapability = outline_.hasFlagCapability || in[1] == kCapabilityOpacityMicromap;
            outline_.capabilities = next;
            break;
        case Op::Extension: {
            const std::string name = textOf(in.subspan(1));
            outline_.hasKhr = outline_.hasKhr || name == kKhrExtension;
            outline_.hasExt = outline_.hasExt || name == kExtExtension;
            outline_.extensions = next;
            break;
        }
        case Op::ExtInstImport:
        case Op::MemoryModel: before_ = next; break;
        case Op::EntryPoint:
            outline_.entryPoints.push_back({textOf(in.subspan(3)), in[1], in[2]});
            outline_.executionModes = next;
            break;
        case Op::ExecutionMode:
        case Op::ExecutionModeId:
            if (isMicromapMode(in))
                outline_.modes.push_back({in[1], op == Op::ExecutionModeId && in.size() > 3 ? in[3] : 0});
            outline_.executionModes = next;
            break;
        case Op::Decorate:
            if (in[2] == kDecorationSpecId && in.size() > 3)
                outline_.specIds[in[1]] = in[3];
            outline_.decorations = next;
            break;
        case Op::String:
        case Op::Source:
        case Op::SourceContinued:
        case Op::SourceExtension:
        case Op::Name:
        case Op::MemberName:
        case Op::ModuleProcessed:
        case Op::MemberDecorate:
        case Op::DecorationGroup:
        case Op::GroupDecorate:
        case Op::GroupMemberDecorate:
        case Op::DecorateId:
        case Op::DecorateString:
        case Op::MemberDecorateString: outline_.decorations = next; break;
        case Op::TypeBool: outline_.boolType = in[1]; break;
        case Op::ConstantTrue:
        case Op::ConstantFalse:
        case Op::ConstantNull:
        case Op::SpecConstantTrue:
        case Op::SpecConstantFalse:
        case Op::SpecConstantOp:
            if (outline_.boolType != 0 && in[1] == outline_.boolType)
                outline_.booleans[in[2]] = op;
            break;
        default: break;
        }
    }

    void code(Op op, Words in)
    {
        if (op == Op::Function) {
            if (function_ == 0)
                outline_.globals = globalsEnd_;
            function_ = in[2];
        }
        Outline::Function &function = outline_.functions[function_];
        if (op == Op::FunctionCall)
            function.callees.insert(in[3]);
        function.queries = function.queries || op == Op::RayQueryInitializeKHR;
        function.traces = function.traces || tracesRay(opcodeOf(in));
    }

    // An empty section is where the one before it ends.
    void finishPositions()
    {
        size_t last = kHeaderWords;
        for (size_t *position : {&outline_.capabilities, &outline_.extensions, &before_, &outline_.executionModes,
                                 &outline_.decorations, &outline_.globals}) {
            if (*position == 0)
                *position = last;
            last = *position;
        }
    }

    Words words_;
    Outline outline_;
    uint32_t function_ = 0;
    size_t before_ = 0;     // the end of what precedes the entry points
    size_t globalsEnd_ = 0; // the end of the last declaration
};

} // namespace

bool isMicromapMode(Words in)
{
    const Op op = opOf(in);
    return (op == Op::ExecutionMode || op == Op::ExecutionModeId) && in.size() > 2 &&
           in[2] == kExecutionModeOpacityMicromapId;
}

std::set<uint32_t> Outline::reaching(bool Function::*property) const
{
    std::map<uint32_t, std::vector<uint32_t>> callers;
    std::vector<uint32_t> work;
    for (const auto &[id, function] : functions) {
        if (function.*property)
            work.push_back(id);
        for (const uint32_t callee : function.callees)
            callers[callee].push_back(id);
    }
    std::set<uint32_t> found;
    while (!work.empty()) {
        const uint32_t next = work.back();
        work.pop_back();
        if (found.insert(next).second)
            work.insert(work.end(), callers[next].begin(), callers[next].end());
    }
    return found;
}

std::optional<Outline> Outline::read(Words words, std::string &error)
{
    return Reader(words).read(error);
}

} // namespace vellum::spirv
