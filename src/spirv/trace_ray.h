// SPDX-License-Identifier: Apache-2.0
// The ray flags of OpTraceRayKHR and similar instructions: removes those that are hidden from the driver
// (core/ray_flags.h).
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

// The flags without `removed`. Constants remain constants; computed flags become a uint.
Id removeFlags(const Module &module, Types &types, Id flags, uint32_t removed, Code &out);

class TraceRays
{
public:
    // `hitObjects`: the side variables for their hidden flags, if any. `reached`: the functions of the stage.
    // `force2State`: the module declares the capability of the ray flag ForceOpacityMicromap2State.
    TraceRays(Module &module, Types &types, const PayloadPrefix &prefix, SideVariables &hitObjects,
              const RewriteOptions &options, const std::set<Id> &reached, bool force2State)
        : module_(module), types_(types), prefix_(prefix), hitObjects_(hitObjects), options_(options),
          reached_(reached), force2State_(force2State)
    {
    }
    // Writes the replacement of an instruction to `out`. False if it is unchanged.
    bool replace(Instruction in, Code &out);
    // Not empty if an instruction cannot be replaced.
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
    Id function_ = 0; // the function that is being rewritten
    std::string error_;
};

} // namespace vellum::spirv
