// SPDX-License-Identifier: Apache-2.0
// Facts about a module that need no parsing.
#pragma once

#include <cstdint>
#include <span>

#include "core/ray_flags.h"

namespace vellum::spirv
{

// The flags of all rays that a module traces in pipelines.
struct TracedFlags {
    bool traces = false;
    uint32_t fixed = shared::kHiddenRayFlags; // flags in which all rays agree
    uint32_t constant = 0;                    // the fixed flags that are set
    uint32_t mostStride = 0;                  // the largest SBT stride; 15 if one is unknown
    void add(const TracedFlags &other);
    bool operator==(const TracedFlags &) const = default;
};

// The result of one pass over a module. Nothing is known of words that are not SPIR-V.
struct ModuleScan {
    bool hasStages = false;  // an entry point is a stage of ray tracing pipelines
    bool tracesRays = false; // it has such a stage, or declares a capability to trace rays
    TracedFlags traced;      // by its stages
};
ModuleScan scan(std::span<const uint32_t> words);

// Returns whether rays have the constant flag ForceOpacityMicromap2State, and the module lacks the capability that it
// needs.
bool forcesTwoStatesWithoutCapability(std::span<const uint32_t> words);

} // namespace vellum::spirv
