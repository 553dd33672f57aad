// SPDX-License-Identifier: Apache-2.0
#include "spirv/trace_ray.h"

#include "spirv/module/code.h"
#include "spirv/module/numbers.h"

namespace vellum::spirv
{

// By exclusive or: lavapipe's traversal takes up to 15 % longer with a mask that its compiler can evaluate (Mesa
// 25.0.7; computed flags that are the same for all rays).
Id removeFlags(const Module &module, Types &types, Id flags, uint32_t removed, Code &out)
{
    if (removed == 0)
        return flags;
    if (const auto value = types.valueOf(flags)) {
        const Id type = module.resultType(module.definition(flags));
        return (*value & removed) == 0 ? flags : types.get(spv::OpConstant, {type, *value & ~removed});
    }
    const Id bits = maskBits(types, flags, removed, out);
    return out.value(spv::OpBitwiseXor, types.uint32(), {flags, bits});
}

// In pipelines without micromaps, only the flag that the driver does not know, which has no effect there.
uint32_t TraceRays::hidden() const
{
    if (options_.pipelineStage)
        return shared::kHiddenRayFlags;
    return force2State_ ? shared::kRayForce2State : 0;
}

// Stores the hidden flags of a ray in its hit object's side variable and in the prefix of its payload, where the
// shaders that it calls read them. Returns false if the hit object or payload is not reached through a variable.
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
        kept = maskBits(types_, module_.word(in, ray.flags), shared::kHiddenRayFlags, out);
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

// A copy would not include the side variable.
bool TraceRays::copiesHitObject(Instruction in)
{
    if (in.opcode == spv::OpLoad)
        return hitObjects_.holds(module_.word(in, 1));
    const Instruction pointer = module_.definition(module_.resultType(module_.definition(module_.word(in, 2))));
    return in.opcode == spv::OpCopyMemory && hitObjects_.holds(module_.word(pointer, 3));
}

// Errors in functions that the stage does not reach are ignored.
bool TraceRays::fail(const char *error)
{
    if (reached_.contains(function_))
        error_ = error;
    return false;
}

bool TraceRays::inPayload() const
{
    return options_.pipelineStage && options_.pipelineStage->hidden.inPayload();
}

bool TraceRays::replace(Instruction in, Code &out)
{
    if (in.opcode == spv::OpFunction)
        function_ = module_.result(in);
    if (hitObjects_.inUse() && copiesHitObject(in))
        return fail("it copies a hit object");
    const auto ray = rayInstruction(in.opcode);
    // RayQueries stores the flags of hit objects that are made from a query.
    if (!ray || (ray->query == 0 && !keepFlags(in, *ray, out)) || ray->flags == 0)
        return false;
    const Id flags = module_.word(in, ray->flags);
    const Id driverFlags = removeFlags(module_, types_, flags, hidden(), out);
    if (driverFlags == flags)
        return false;
    out.out.push_back(module_.with(in, ray->flags, driverFlags));
    return true;
}

} // namespace vellum::spirv
