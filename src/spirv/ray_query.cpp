#include "spirv/ray_query.h"

#include "core/ray_flags.h"
#include "spirv/built_ins.h"
#include "spirv/opcodes.h"
#include "spirv/trace_ray.h"

#include <algorithm>

namespace vellum::spirv
{
namespace
{

using shared::kHiddenRayFlags;
constexpr std::uint32_t kOpacityFlags = kHiddenRayFlags | shared::kRayNoOpaque | shared::kRayCullOpaque;

} // namespace

// Most modules pass literal flags, the same everywhere. Then nothing has to travel in the driver's flags, and the
// resolution of a hit shrinks to what those flags leave of it.
RayFlagMode RayQueries::findMode(const Module &module, const Types &types)
{
    RayFlagMode mode;
    bool first = true;
    for (const Instruction in : module.section(Section::Functions)) {
        if (in.opcode != spv::OpRayQueryInitializeKHR)
            continue;
        const auto flags = types.valueOf(module.word(in, 3));
        if (!flags)
            return {};
        if (first)
            mode = {.hidden = *flags & kHiddenRayFlags, .all = *flags & kOpacityFlags};
        else if (mode.hidden != (*flags & kHiddenRayFlags))
            return {};
        else if (mode.all != (*flags & kOpacityFlags))
            mode.all.reset();
        first = false;
    }
    return mode;
}

RayQueries::RayQueries(Module &module, Types &types, Linker &linker, bool carriesFlagBits)
    : module_(module), types_(types), linker_(linker), mode_(findMode(module, types)),
      carriesFlagBits_(carriesFlagBits), candidates_(module, types, linker, mode_)
{
}

bool RayQueries::rewrite()
{
    const std::vector<Instruction> code = module_.section(Section::Functions);
    std::vector<Instruction> out;
    out.reserve(code.size());
    bool changed = false;
    for (std::size_t begin = 0; begin < code.size();) {
        std::size_t end = begin;
        while (end < code.size() && code[end++].opcode != spv::OpFunctionEnd) {
        }
        changed = rewriteFunction(std::span(code).subspan(begin, end - begin), out) || changed;
        begin = end;
    }
    if (!error_.empty())
        return false;
    module_.section(Section::Functions) = std::move(out);
    candidates_.finish();
    return changed;
}

bool RayQueries::rewriteFunction(std::span<const Instruction> code, std::vector<Instruction> &out)
{
    Function function = splitFunction(module_, code);
    bool changed = false;
    for (std::size_t b = 0; b < function.blocks.size(); ++b)
        for (std::size_t i = 0; i < function.blocks[b].code.size(); ++i)
            if (function.blocks[b].code[i].opcode == spv::OpRayQueryProceedKHR)
                changed = decideInLoop(function, b, i) || changed;

    Code rewritten(module_);
    const auto append = [&](const std::vector<Instruction> &part) {
        rewritten.out.insert(rewritten.out.end(), part.begin(), part.end());
    };
    append(function.head);
    for (const Block &block : function.blocks) {
        for (const Instruction in : block.code) {
            if (replace(in, rewritten))
                changed = true;
            else
                rewritten.out.push_back(in);
        }
        append(block.behind);
    }
    append(function.tail);
    out.insert(out.end(), rewritten.out.begin(), rewritten.out.end());
    return changed;
}

bool RayQueries::decideInLoop(Function &function, std::size_t block, std::size_t call)
{
    const auto loop = findProceedLoop(module_, function, block, call);
    const Instruction in = function.blocks[block].code[call];
    const auto access = candidates_.access(module_.word(in, 3));
    if (!loop || !access)
        return false;
    Code decision(module_);
    std::vector<std::uint32_t> operands = access->arguments;
    operands.insert(operands.begin(), candidates_.candidate(*access));
    const Id handled = decision.value(spv::OpFunctionCall, types_.boolean(), operands);
    insertDecision(module_, function, *loop, decision, handled);
    decidedInLoops_.insert(module_.result(in));
    return true;
}

bool RayQueries::replace(Instruction in, Code &out)
{
    switch (in.opcode) {
    case spv::OpRayQueryInitializeKHR: return initialize(in, out);
    case spv::OpRayQueryProceedKHR: return proceed(in, out);
    case spv::OpRayQueryGetRayFlagsKHR: return getRayFlags(in, out);
    case spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR: return getAabbOpaque(in, out);
    case spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR:
        restoreResult(module_, types_, linker_.function("vellumCustomIndex"), in, out);
        return true;
    default: return false;
    }
}

bool RayQueries::initialize(Instruction in, Code &out)
{
    const Id flags = module_.word(in, 3);
    if (mode_.hidden) {
        if (*mode_.hidden == 0)
            return false;
        const Id type = module_.resultType(module_.definition(flags));
        const std::uint32_t value = types_.valueOf(flags).value_or(0) & ~kHiddenRayFlags;
        out.out.push_back(module_.with(in, 3, types_.get(spv::OpConstant, {type, value})));
        return true;
    }
    if (!carriesFlagBits_) {
        error_ = "the ray flags of its ray queries are not constant or not alike, and the driver does not carry unused "
                 "flag bits";
        return false;
    }
    out.out.push_back(module_.with(in, 3, hideRayFlags(module_, types_, linker_, flags, out)));
    return true;
}

bool RayQueries::proceed(Instruction in, Code &out)
{
    if (decidedInLoops_.contains(module_.result(in)))
        return false;
    const auto access = candidates_.access(module_.word(in, 3));
    if (!access) {
        error_ = "OpRayQueryProceedKHR on a ray query that is not reached through a variable or parameter";
        return false;
    }
    std::vector<std::uint32_t> operands{module_.resultType(in), module_.result(in), candidates_.proceed(*access)};
    operands.insert(operands.end(), access->arguments.begin(), access->arguments.end());
    out.put(spv::OpFunctionCall, operands);
    return true;
}

bool RayQueries::getRayFlags(Instruction in, Code &out)
{
    const Id type = module_.resultType(in);
    if (mode_.hidden && *mode_.hidden == 0)
        return false;
    if (mode_.hidden) {
        const Id flags = out.value(spv::OpRayQueryGetRayFlagsKHR, type, {module_.word(in, 3)});
        out.put(spv::OpBitwiseOr,
                {type, module_.result(in), flags, types_.get(spv::OpConstant, {type, *mode_.hidden})});
        return true;
    }
    restoreResult(module_, types_, linker_.function("vellumApplicationFlags"), in, out);
    return true;
}

// With the Opaque flag, which the driver does not see, every box is opaque.
bool RayQueries::getAabbOpaque(Instruction in, Code &out)
{
    if (mode_.hidden && (*mode_.hidden & shared::kRayOpaque) == 0)
        return false;
    const Id boolean = types_.boolean();
    const Id query = module_.word(in, 3);
    const Id byDriver = out.value(in.opcode, boolean, {query});
    Id byFlags = types_.constantTrue();
    if (!mode_.hidden) {
        const Id uint = types_.uint32();
        const Id bit = out.value(spv::OpBitwiseAnd, uint,
                                 {candidates_.opacityFlags(out, query), types_.uintConstant(shared::kRayOpaque)});
        byFlags = out.value(spv::OpINotEqual, boolean, {bit, types_.uintConstant(0)});
    }
    out.put(spv::OpLogicalOr, {boolean, module_.result(in), byDriver, byFlags});
    return true;
}

} // namespace vellum::spirv
