#include "spirv/trace_ray.h"

#include <algorithm>
#include <unordered_map>

#include "core/ray_flags.h"
#include "spirv/module/opcodes.h"
#include "spirv/module/ray_instructions.h"

namespace vellum::spirv
{
namespace
{

constexpr std::uint32_t kStrideMask = 15; // the bits of an SBT stride that are used (OpTraceRayKHR)

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

Id hiddenBits(Types &types, Id flags, Code &out)
{
    if (const auto value = types.valueOf(flags))
        return types.uintConstant(*value & shared::kHiddenRayFlags);
    return out.value(spv::OpBitwiseAnd, types.uint32(), {flags, types.uintConstant(shared::kHiddenRayFlags)});
}

Id TraceRays::idleFlags(Id flags, Code &out)
{
    const auto value = types_.valueOf(flags);
    if (!force2State_ || (value && (*value & shared::kRayForce2State) == 0))
        return flags;
    if (options_.pipelinesCarryFlagBits())
        return hideUnknownFlag(module_, types_, linker_, flags, out);
    return removeFlags(types_, flags, module_.resultType(module_.definition(flags)), shared::kRayForce2State, out);
}

// Stores the hidden flags of a ray beside its hit object and before its payload, from where the shaders that it calls
// read them. False if one of these is not known.
bool TraceRays::keepFlags(Instruction in, const RayInstruction &ray, Code &out)
{
    const bool hasPayload = ray.payload != 0 && inPayload();
    Id object = 0;
    if (ray.hitObject != 0 && hitObjects_.inUse())
        object = hitObjects_.pointer(module_.word(in, ray.hitObject), out);
    if (object == 0 && ray.hitObject != 0 && (hitObjects_.inUse() || hasPayload))
        return fail("it uses a hit object that is not reached through a variable or parameter");
    if (object == 0 && !hasPayload)
        return true;
    const Id uint = types_.uint32();
    Id kept = types_.uintConstant(0);
    if (ray.onlyExecutes())
        kept = out.value(spv::OpLoad, uint, {object});
    else if (ray.flags != 0)
        kept = hiddenBits(types_, module_.word(in, ray.flags), out);
    if (object != 0 && !ray.onlyExecutes())
        out.put(spv::OpStore, {object, kept});
    if (!hasPayload)
        return true;
    const Id prefix = prefix_.pointer(module_.word(in, ray.payload), out);
    if (prefix == 0)
        return fail("it traces rays with a payload that is no variable");
    out.put(spv::OpStore, {prefix, kept});
    return true;
}

// What lies beside it would stay behind.
bool TraceRays::copiesHitObject(Instruction in)
{
    if (in.opcode == spv::OpLoad)
        return hitObjects_.holds(module_.word(in, 1));
    const Instruction pointer = module_.definition(module_.resultType(module_.definition(module_.word(in, 2))));
    return in.opcode == spv::OpCopyMemory && hitObjects_.holds(module_.word(pointer, 3));
}

// What is wrong in functions that the stage does not reach does not matter.
bool TraceRays::fail(const char *error)
{
    if (reached_.contains(function_))
        error_ = error;
    return false;
}

Id TraceRays::hiddenFrom(Id flags, Code &out)
{
    const auto value = types_.valueOf(flags);
    if (value && (*value & shared::kHiddenRayFlags) == 0)
        return flags;
    if (options_.pipelineStage->hidden.way == HiddenFlags::Way::Carried)
        return hideRayFlags(module_, types_, linker_, flags, out);
    return removeFlags(types_, flags, module_.resultType(module_.definition(flags)), shared::kHiddenRayFlags, out);
}

bool TraceRays::inPayload() const
{
    return options_.pipelineStage && options_.pipelineStage->hidden.way == HiddenFlags::Way::InPayload;
}

bool TraceRays::replace(Instruction in, Code &out)
{
    if (in.opcode == spv::OpFunction)
        function_ = module_.result(in);
    if (hitObjects_.inUse() && copiesHitObject(in))
        return fail("it copies a hit object");
    const auto ray = rayInstruction(in.opcode);
    // RayQueries keeps the flags of those that are made from a query.
    if (!ray || (ray->query == 0 && !keepFlags(in, *ray, out)) || ray->flags == 0)
        return false;
    const Id flags = module_.word(in, ray->flags);
    const Id hidden = options_.pipelineStage ? hiddenFrom(flags, out) : idleFlags(flags, out);
    if (hidden == flags)
        return false;
    out.out.push_back(module_.with(in, ray->flags, hidden));
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
        if (opcode == spv::OpConstant && count == 4)
            constants[words[at + 2]] = words[at + 3];
        else if (opcode == spv::OpConstantNull && count == 3)
            constants[words[at + 2]] = 0;
        else if (opcode == spv::OpRayQueryInitializeKHR)
            queries.insert(bitsOf(3, shared::kHiddenRayFlags));
        else if (const auto ray = rayInstruction(opcode); ray && !ray->onlyExecutes() && !ray->empties) {
            fromQuery = fromQuery || ray->query != 0;
            if (ray->query == 0)
                traced.insert(ray->flags != 0 ? bitsOf(ray->flags, shared::kHiddenRayFlags) : 0);
            if (ray->stride() != 0)
                mostStride = std::max(mostStride, bitsOf(ray->stride(), kStrideMask).value_or(kStrideMask));
        }
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
