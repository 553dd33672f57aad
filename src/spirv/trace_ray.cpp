#include "spirv/trace_ray.h"

#include "core/ray_flags.h"
#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

// The word that holds the ray flags; 0 for instructions that trace nothing.
std::uint32_t rayFlagsWord(std::uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTraceRayKHR:
    case kOpTraceRayMotionNV: return 2;
    case kOpHitObjectTraceRayNV:
    case kOpHitObjectTraceRayMotionNV:
    case kOpHitObjectTraceRayEXT:
    case kOpHitObjectTraceRayMotionEXT:
    case kOpHitObjectTraceReorderExecuteEXT:
    case kOpHitObjectTraceMotionReorderExecuteEXT: return 3;
    default: return 0;
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

bool TraceRays::replace(Instruction in, Code &out)
{
    const std::uint32_t word = rayFlagsWord(in.opcode);
    if (word == 0)
        return false;
    const Id flags = module_.word(in, word);
    if (hides_ == Hides::UnknownFlag) {
        const Id hidden = hideUnknownFlag(module_, types_, linker_, flags, out);
        if (hidden != flags)
            out.out.push_back(module_.with(in, word, hidden));
        return hidden != flags;
    }
    const auto value = types_.valueOf(flags);
    if (value && (*value & shared::kHiddenRayFlags) == 0)
        return false;
    if (!carriesFlagBits_()) {
        error_ =
            "it traces rays with flags that have to be hidden from the driver, or are not constant, and the driver "
            "does not carry unused flag bits";
        return false;
    }
    const Id hidden = hideRayFlags(module_, types_, linker_, flags, out);
    out.out.push_back(module_.with(in, word, hidden));
    return true;
}

} // namespace vellum::spirv
