// The ray flags of OpTraceRayKHR and its kin, on their way to the driver (core/ray_flags.h).
#pragma once

#include <set>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"

namespace vellum::spirv
{

// The flags as the driver gets them. Constants stay constants.
Id hideRayFlags(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The same where rays do not consume micromaps: only ForceOpacityMicromap2State is hidden, which the driver does not
// know. It does nothing there, and comes back to the application.
Id hideUnknownFlag(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The flags without some. Constants stay constants; what is computed becomes a uint.
Id removeFlags(Types &types, Id flags, Id type, std::uint32_t removed, Code &out);

class TraceRays
{
public:
    // `reached`: the functions of the stage, if it is one.
    TraceRays(Module &module, Types &types, Linker &linker, const PayloadPrefix &prefix, const RewriteOptions &options,
              const std::set<Id> &reached)
        : module_(module), types_(types), linker_(linker), prefix_(prefix), options_(options), reached_(reached)
    {
    }
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // Not empty once an instruction was met that cannot be replaced.
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    // In a pipeline that does not use micromaps.
    Id idleFlags(Id flags, Code &out);
    // In one that does: `flags` by which way the hidden ones travel.
    bool keepInPayload(Instruction in, Id flags, Code &out);
    bool fail(const char *error);

    Module &module_;
    Types &types_;
    Linker &linker_;
    const PayloadPrefix &prefix_;
    const RewriteOptions &options_;
    const std::set<Id> &reached_;
    Id function_ = 0; // that is being rewritten
    std::string error_;
};

} // namespace vellum::spirv
