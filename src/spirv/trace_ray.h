// The ray flags of OpTraceRayKHR and its kin, on their way to the driver (core/ray_flags.h).
#pragma once

#include <set>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/ray_instructions.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"
#include "spirv/side_variables.h"

namespace vellum::spirv
{

// The flags without some, as the driver gets them. Constants stay constants; what is computed becomes a uint.
Id removeFlags(const Module &module, Types &types, Id flags, uint32_t removed, Code &out);

class TraceRays
{
public:
    // `hitObjects`: their hidden flags, if they are kept. `reached`: the functions of the stage, if it is one.
    // `force2State`: the module declares the capability of the ray flag ForceOpacityMicromap2State.
    TraceRays(Module &module, Types &types, const PayloadPrefix &prefix, SideVariables &hitObjects,
              const RewriteOptions &options, const std::set<Id> &reached, bool force2State)
        : module_(module), types_(types), prefix_(prefix), hitObjects_(hitObjects), options_(options),
          reached_(reached), force2State_(force2State)
    {
    }
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // Not empty once an instruction was met that cannot be replaced.
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    // The flags that are hidden from the driver.
    [[nodiscard]] uint32_t hidden() const;
    [[nodiscard]] bool inPayload() const;
    bool keepFlags(Instruction in, const RayInstruction &ray, Code &out);
    bool copiesHitObject(Instruction in);
    bool fail(const char *error);

    Module &module_;
    Types &types_;
    const PayloadPrefix &prefix_;
    SideVariables &hitObjects_;
    const RewriteOptions &options_;
    const std::set<Id> &reached_;
    bool force2State_;
    Id function_ = 0; // that is being rewritten
    std::string error_;
};

} // namespace vellum::spirv
