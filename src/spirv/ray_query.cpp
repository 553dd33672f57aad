// SPDX-License-Identifier: Apache-2.0
#include "spirv/ray_query.h"

#include "core/ray_flags.h"
#include "spirv/built_ins.h"
#include "spirv/module/code.h"
#include "spirv/module/numbers.h"
#include "spirv/trace_ray.h"

#include <algorithm>

namespace vellum::spirv
{
namespace
{

using shared::kHiddenRayFlags;
constexpr uint32_t kOpacityFlags = kHiddenRayFlags | shared::kRayNoOpaque | shared::kRayCullOpaque;

} // namespace

// Most modules pass the same literal flags everywhere. These need no side variables, and simplify the resolution of
// hits.
RayFlagMode RayQueries::findMode() const
{
    RayFlagMode mode;
    bool first = true;
    bool consumes = false;
    for (const Instruction in : module_.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            consumes = consumption_.in(module_.result(in)).when != Consumes::When::Never;
        if (in.opcode != spv::OpRayQueryInitializeKHR || !consumes)
            continue;
        const auto flags = types_.valueOf(module_.word(in, 3));
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

RayQueries::RayQueries(Module &module, Types &types, Linker &linker, Consumption &consumption,
                       SideVariables &hitObjects, RayQueryOptions options)
    : module_(module), types_(types), linker_(linker), reached_(options.reached), consumption_(consumption),
      hitObjects_(hitObjects), options_(options), definesConvergence_(definesConvergence(module)),
      mode_(options.constantFlags ? findMode() : RayFlagMode{}), queryFlags_(module, types, Beside::RayQueries),
      indices_(module, types, consumption),
      candidates_(module, types, linker, consumption, queryFlags_, indices_, mode_)
{
}

bool RayQueries::travel() const
{
    Consumes consumes;
    for (const Instruction in : module_.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            consumes = consumption_.in(module_.result(in));
        if (in.opcode != spv::OpRayQueryInitializeKHR)
            continue;
        if (consumes.when != Consumes::When::Never && !mode_.hidden)
            return true;
        const auto flags = types_.valueOf(module_.word(in, 3));
        if (consumes.when != Consumes::When::Always && options_.force2State &&
            !(flags && (*flags & shared::kRayForce2State) == 0))
            return true;
    }
    return false;
}

bool RayQueries::rewrite()
{
    if (travel() && !queryFlags_.declare()) {
        error_ = queryFlags_.error();
        return false;
    }
    if (!indices_.declare()) {
        error_ = indices_.error();
        return false;
    }
    const std::vector<Instruction> code = module_.section(Section::Functions);
    std::vector<Instruction> out;
    out.reserve(code.size());
    bool changed = false;
    for (size_t begin = 0; begin < code.size();) {
        size_t end = begin;
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
    for (const Instruction in : function.head)
        if (in.opcode == spv::OpFunction) {
            function_ = module_.result(in);
            consumes_ = consumption_.in(function_);
        }
    for (size_t b = 0; b < function.blocks.size(); ++b)
        for (size_t i = 0; i < function.blocks[b].code.size(); ++i)
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

bool RayQueries::decideInLoop(Function &function, size_t block, size_t call)
{
    if (consumes_.when == Consumes::When::Never || definesConvergence_)
        return false;
    const auto loop = findProceedLoop(module_, function, block, call);
    const Instruction in = function.blocks[block].code[call];
    const auto access = candidates_.access(module_.word(in, 3));
    if (!loop || !access)
        return false;
    Code decision(module_);
    std::vector<uint32_t> operands = access->arguments;
    operands.insert(operands.begin(), candidates_.candidate(*access, consumes_));
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
    case spv::OpHitObjectRecordFromQueryEXT: keepInHitObject(in, out); return false;
    case spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR: getCustomIndex(in, out); return true;
    default: return false;
    }
}

Id RayQueries::choose(Id type, Id consuming, Id idle, Code &out)
{
    if (consumes_.when == Consumes::When::Never)
        return idle;
    if (!consumes_.isConditional() || consuming == idle)
        return consuming;
    return out.value(spv::OpSelect, type, {consumption_.condition(consumes_, out), consuming, idle});
}

Id RayQueries::consumingFlags(Id flags, Code &out)
{
    return removeFlags(module_, types_, flags, kHiddenRayFlags, out);
}

// ForceOpacityMicromap2State, which the driver does not know, has no effect here, but the application may read it.
Id RayQueries::idleFlags(Id flags, Code &out)
{
    return options_.force2State ? removeFlags(module_, types_, flags, shared::kRayForce2State, out) : flags;
}

bool RayQueries::keepFlags(Instruction in, Code &out)
{
    const Id pointer = queryFlags_.pointer(module_.word(in, 1), out);
    if (pointer == 0) {
        error_ = "OpRayQueryInitializeKHR on a ray query that is not reached through a variable or parameter";
        return false;
    }
    const Id flags = module_.word(in, 3);
    out.put(spv::OpStore, {pointer, toUint(types_, module_.resultType(module_.definition(flags)), flags, out)});
    return true;
}

// Stores the query's flags that the driver does not have in the hit object's side variable. Others are harmless there.
void RayQueries::keepInHitObject(Instruction in, Code &out)
{
    if (!hitObjects_.inUse())
        return;
    const Id object = hitObjects_.pointer(module_.word(in, 1), out);
    const bool never = consumes_.when == Consumes::When::Never;
    Id hidden = types_.uintConstant(never ? 0 : mode_.hidden.value_or(0));
    if (queryFlags_.inUse()) {
        const Id flags = queryFlags_.pointer(module_.word(in, 2), out);
        hidden =
            flags == 0 ? 0 : maskBits(types_, out.value(spv::OpLoad, types_.uint32(), {flags}), kHiddenRayFlags, out);
    }
    if (object != 0 && hidden != 0)
        out.put(spv::OpStore, {object, hidden});
    else if (reached_.contains(function_))
        error_ =
            "it makes a hit object from a ray query, and one of them is not reached through a variable or parameter";
}

bool RayQueries::initialize(Instruction in, Code &out)
{
    const Id flags = module_.word(in, 3);
    const bool never = consumes_.when == Consumes::When::Never;
    const bool kept = queryFlags_.inUse();
    if (kept && !keepFlags(in, out))
        return false;
    Id consuming = never ? flags : consumingFlags(flags, out);
    Id idle = consumes_.when == Consumes::When::Always ? consuming : idleFlags(flags, out);
    if (consuming == flags && idle == flags && !kept)
        return false;
    Id type = module_.resultType(module_.definition(flags));
    if (consumes_.isConditional() && !types_.valueOf(flags)) { // computed flags are uint
        for (Id *one : {&consuming, &idle})
            if (*one == flags)
                *one = toUint(types_, type, flags, out);
        type = types_.uint32();
    }
    out.out.push_back(module_.with(in, 3, choose(type, consuming, idle, out)));
    return true;
}

bool RayQueries::proceed(Instruction in, Code &out)
{
    if (consumes_.when == Consumes::When::Never || decidedInLoops_.contains(module_.result(in)))
        return false;
    const auto access = candidates_.access(module_.word(in, 3));
    if (!access) {
        error_ = "OpRayQueryProceedKHR on a ray query that is not reached through a variable or parameter";
        return false;
    }
    std::vector<uint32_t> operands{module_.resultType(in), module_.result(in), candidates_.proceed(*access, consumes_)};
    operands.insert(operands.end(), access->arguments.begin(), access->arguments.end());
    out.put(spv::OpFunctionCall, operands);
    return true;
}

bool RayQueries::getRayFlags(Instruction in, Code &out)
{
    if (queryFlags_.inUse())
        return getKeptFlags(in, out);
    const uint32_t hidden = mode_.hidden.value_or(0);
    if (consumes_.when == Consumes::When::Never || hidden == 0)
        return false;
    const Id type = module_.resultType(in);
    const Id flags = out.value(spv::OpRayQueryGetRayFlagsKHR, type, {module_.word(in, 3)});
    const Id all = out.value(spv::OpBitwiseOr, type, {flags, types_.get(spv::OpConstant, {type, hidden})});
    out.put(spv::OpCopyObject, {type, module_.result(in), choose(type, all, flags, out)});
    return true;
}

bool RayQueries::getKeptFlags(Instruction in, Code &out)
{
    const Id pointer = queryFlags_.pointer(module_.word(in, 3), out);
    if (pointer == 0) {
        error_ = "OpRayQueryGetRayFlagsKHR on a ray query that is not reached through a variable or parameter";
        return false;
    }
    loadUint(module_, types_, pointer, in, out);
    return true;
}

void RayQueries::getCustomIndex(Instruction in, Code &out)
{
    const Id known = indices_.of(in);
    if (known == 0)
        restoreResult(module_, types_, linker_.function("vellumCustomIndex"), in, out);
    else
        loadUint(module_, types_, known, in, out);
}

// With the Opaque flag, which is hidden from the driver, every box is opaque.
bool RayQueries::getAabbOpaque(Instruction in, Code &out)
{
    if (consumes_.when == Consumes::When::Never || (mode_.hidden && (*mode_.hidden & shared::kRayOpaque) == 0))
        return false;
    const Id boolean = types_.boolean();
    const Id query = module_.word(in, 3);
    const Id byDriver = out.value(in.opcode, boolean, {query});
    Id byFlags = types_.constantTrue();
    if (!mode_.hidden) {
        const Id flags = queryFlags_.inUse() ? queryFlags_.pointer(query, out) : 0;
        if (queryFlags_.inUse() && flags == 0) {
            error_ = "OpRayQueryGetIntersectionCandidateAABBOpaqueKHR on a ray query that is not reached through a "
                     "variable or parameter";
            return false;
        }
        byFlags = hasBits(types_, candidates_.opacityFlags(out, {query, flags}), shared::kRayOpaque, out);
    }
    if (consumes_.isConditional())
        byFlags = out.value(spv::OpLogicalAnd, boolean, {byFlags, consumption_.condition(consumes_, out)});
    out.put(spv::OpLogicalOr, {boolean, module_.result(in), byDriver, byFlags});
    return true;
}

} // namespace vellum::spirv
