#include "spirv/trace_ray.h"

#include <algorithm>
#include <unordered_map>

#include "core/ray_flags.h"
#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

constexpr std::uint32_t kStrideMask = 15; // the bits of an SBT stride that are used (OpTraceRayKHR)

// The word that holds the flags of a ray that is traced, or that a hit object is told to have missed with; 0 for other
// instructions.
std::uint32_t rayFlagsWord(std::uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTraceRayKHR:
    case kOpTraceRayMotionNV:
    case kOpHitObjectRecordMissEXT:
    case kOpHitObjectRecordMissMotionEXT: return 2;
    case kOpHitObjectTraceRayNV:
    case kOpHitObjectTraceRayMotionNV:
    case kOpHitObjectTraceRayEXT:
    case kOpHitObjectTraceRayMotionEXT:
    case kOpHitObjectTraceReorderExecuteEXT:
    case kOpHitObjectTraceMotionReorderExecuteEXT: return 3;
    default: return 0;
    }
}

// The word that holds the SBT stride of a ray that is traced; 0 for other instructions.
std::uint32_t strideWord(std::uint32_t opcode)
{
    const bool misses = opcode == kOpHitObjectRecordMissEXT || opcode == kOpHitObjectRecordMissMotionEXT;
    const std::uint32_t flags = rayFlagsWord(opcode);
    return flags == 0 || misses ? 0 : flags + 3; // behind cull mask and SBT offset
}

bool recordsWithoutFlags(std::uint32_t opcode)
{
    switch (opcode) {
    case kOpHitObjectRecordHitMotionNV:
    case kOpHitObjectRecordHitWithIndexMotionNV:
    case kOpHitObjectRecordMissMotionNV:
    case kOpHitObjectRecordHitNV:
    case kOpHitObjectRecordHitWithIndexNV:
    case kOpHitObjectRecordMissNV: return true;
    default: return false;
    }
}

} // namespace

Id hideRayFlags(Module &module, Types &types, Linker &linker, Id flags, Code &out)
{
    const Id type = module.resultType(module.definition(flags));
    if (const auto value = types.valueOf(flags))
        return types.get(spv::OpConstant, {type, shared::driverRayFlags(*value)});
    const Id uint = types.uint32();
    // The type of what an unknown instruction made is unknown too; a cast to the same type does no harm.
    const Id asUint = type == uint ? flags : out.value(spv::OpBitcast, uint, {flags});
    return out.value(spv::OpFunctionCall, uint, {linker.function("vellumDriverFlags"), asUint});
}

Id hideUnknownFlag(Module &module, Types &types, Linker &linker, Id flags, Code &out)
{
    const auto value = types.valueOf(flags);
    if (value && (*value & shared::kRayForce2State) == 0)
        return flags;
    const Id type = module.resultType(module.definition(flags));
    if (value)
        return types.get(spv::OpConstant, {type, shared::idleRayFlags(*value)});
    const Id uint = types.uint32();
    const Id asUint = type == uint ? flags : out.value(spv::OpBitcast, uint, {flags});
    return out.value(spv::OpFunctionCall, uint, {linker.function("vellumIdleFlags"), asUint});
}

Id removeFlags(Types &types, Id flags, Id type, std::uint32_t removed, Code &out)
{
    if (const auto value = types.valueOf(flags))
        return (*value & removed) == 0 ? flags : types.get(spv::OpConstant, {type, *value & ~removed});
    const Id uint = types.uint32();
    const Id asUint = type == uint ? flags : out.value(spv::OpBitcast, uint, {flags});
    return out.value(spv::OpBitwiseAnd, uint, {asUint, types.uintConstant(~removed)});
}

Id TraceRays::idleFlags(Id flags, Code &out)
{
    const auto value = types_.valueOf(flags);
    if (value && (*value & shared::kRayForce2State) == 0)
        return flags;
    if (options_.pipelinesCarryFlagBits())
        return hideUnknownFlag(module_, types_, linker_, flags, out);
    return removeFlags(types_, flags, module_.resultType(module_.definition(flags)), shared::kRayForce2State, out);
}

bool TraceRays::keepInPayload(Instruction in, Id flags, Code &out)
{
    if (makesOrExecutesHitObject(in.opcode))
        return fail("it uses hit objects, and the driver does not carry unused ray flag bits");
    Id payload = 0;
    if (in.opcode == spv::OpTraceRayKHR)
        payload = module_.word(in, 11);
    else if (in.opcode == kOpTraceRayMotionNV)
        payload = module_.word(in, 12);
    const Id prefix = prefix_.pointer(payload, out);
    if (prefix == 0)
        return fail("it traces rays with a payload that is no variable");
    const Id uint = types_.uint32();
    const Id hidden = types_.uintConstant(shared::kHiddenRayFlags);
    Id kept = 0;
    if (const auto value = types_.valueOf(flags))
        kept = types_.uintConstant(*value & shared::kHiddenRayFlags);
    else
        kept = out.value(spv::OpBitwiseAnd, uint, {flags, hidden}); // of either signedness
    out.put(spv::OpStore, {prefix, kept});
    return true;
}

// What is wrong in functions that the stage does not reach does not matter.
bool TraceRays::fail(const char *error)
{
    if (reached_.contains(function_))
        error_ = error;
    return false;
}

bool TraceRays::replace(Instruction in, Code &out)
{
    if (in.opcode == spv::OpFunction)
        function_ = module_.result(in);
    const std::uint32_t word = rayFlagsWord(in.opcode);
    if (word == 0) {
        // The shaders that it calls would find no flags in the payload.
        if (makesOrExecutesHitObject(in.opcode) && options_.pipelineStage &&
            options_.pipelineStage->hidden.way == HiddenFlags::Way::InPayload)
            keepInPayload(in, 0, out);
        return false;
    }
    const Id flags = module_.word(in, word);
    if (!options_.pipelineStage) {
        const Id idle = idleFlags(flags, out);
        if (idle != flags)
            out.out.push_back(module_.with(in, word, idle));
        return idle != flags;
    }
    const auto way = options_.pipelineStage->hidden.way;
    if (way == HiddenFlags::Way::InPayload && !keepInPayload(in, flags, out))
        return false;
    const auto value = types_.valueOf(flags);
    if (value && (*value & shared::kHiddenRayFlags) == 0 && way != HiddenFlags::Way::InPayload)
        return false;
    const Id hidden =
        way == HiddenFlags::Way::Carried
            ? hideRayFlags(module_, types_, linker_, flags, out)
            : removeFlags(types_, flags, module_.resultType(module_.definition(flags)), shared::kHiddenRayFlags, out);
    out.out.push_back(module_.with(in, word, hidden));
    return true;
}

TracedFlags tracedFlags(std::span<const std::uint32_t> words)
{
    if (words.size() < 5 || words[0] != spv::MagicNumber)
        return {};
    std::unordered_map<std::uint32_t, std::uint32_t> constants;
    std::set<std::optional<std::uint32_t>> traced, queries;
    bool fromQuery = false;
    std::uint32_t mostStride = 0;
    for (std::size_t at = 5; at < words.size();) {
        const std::uint32_t opcode = words[at] & 0xffff;
        const std::uint32_t count = words[at] >> 16;
        if (count == 0 || count > words.size() - at)
            return {.traces = fromQuery || !traced.empty(), .hidden = {}};
        const auto bitsOf = [&](std::uint32_t word, std::uint32_t mask) -> std::optional<std::uint32_t> {
            const auto value = word < count ? constants.find(words[at + word]) : constants.end();
            return value == constants.end() ? std::nullopt : std::optional(value->second & mask);
        };
        if (const std::uint32_t word = strideWord(opcode); word != 0)
            mostStride = std::max(mostStride, bitsOf(word, kStrideMask).value_or(kStrideMask));
        if (opcode == spv::OpConstant && count == 4)
            constants[words[at + 2]] = words[at + 3];
        else if (opcode == spv::OpConstantNull && count == 3)
            constants[words[at + 2]] = 0;
        else if (const std::uint32_t word = rayFlagsWord(opcode); word != 0)
            traced.insert(bitsOf(word, shared::kHiddenRayFlags));
        else if (recordsWithoutFlags(opcode))
            traced.insert(0);
        else if (opcode == spv::OpRayQueryInitializeKHR)
            queries.insert(bitsOf(3, shared::kHiddenRayFlags));
        else if (opcode == kOpHitObjectRecordFromQueryEXT)
            fromQuery = true;
        at += count;
    }
    // Hit objects that are made from a ray query have the flags that the driver knows of the query. If some are hidden,
    // they travel with it (RayQueries::findMode), and so with the rays.
    if (fromQuery)
        traced.insert(queries == decltype(queries){0} ? std::optional(0u) : std::nullopt);
    return {.traces = !traced.empty(),
            .hidden = traced.size() == 1 ? *traced.begin() : std::nullopt,
            .mostStride = mostStride};
}

} // namespace vellum::spirv
