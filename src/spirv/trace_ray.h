// The ray flags of OpTraceRayKHR and its kin, on their way to the driver (core/ray_flags.h).
#pragma once

#include <set>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/module/ray_instructions.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"
#include "spirv/side_variables.h"

namespace vellum::spirv
{

// The flags as the driver gets them. Constants stay constants.
Id hideRayFlags(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The same where rays do not consume micromaps: only ForceOpacityMicromap2State is hidden, which the driver does not
// know. It does nothing there, and comes back to the application.
Id hideUnknownFlag(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The flags without some. Constants stay constants; what is computed becomes a uint.
Id removeFlags(Types &types, Id flags, Id type, std::uint32_t removed, Code &out);

// The flags that are hidden from the driver, of flags of either signedness. A uint.
Id hiddenBits(Types &types, Id flags, Code &out);

class TraceRays
{
public:
    // `hitObjects`: their hidden flags, if they are kept. `reached`: the functions of the stage, if it is one.
    // `force2State`: the module declares the capability of the ray flag ForceOpacityMicromap2State.
    TraceRays(Module &module, Types &types, Linker &linker, const PayloadPrefix &prefix, SideVariables &hitObjects,
              const RewriteOptions &options, const std::set<Id> &reached, bool force2State)
        : module_(module), types_(types), linker_(linker), prefix_(prefix), hitObjects_(hitObjects), options_(options),
          reached_(reached), force2State_(force2State)
    {
    }
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // Not empty once an instruction was met that cannot be replaced.
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    // In a pipeline that does not use micromaps.
    Id idleFlags(Id flags, Code &out);
    // In one that does.
    Id hiddenFrom(Id flags, Code &out);
    [[nodiscard]] bool inPayload() const;
    bool keepFlags(Instruction in, const RayInstruction &ray, Code &out);
    bool copiesHitObject(Instruction in);
    bool fail(const char *error);

    Module &module_;
    Types &types_;
    Linker &linker_;
    const PayloadPrefix &prefix_;
    SideVariables &hitObjects_;
    const RewriteOptions &options_;
    const std::set<Id> &reached_;
    bool force2State_;
    Id function_ = 0; // that is being rewritten
    std::string error_;
};

} // namespace vellum::spirv
