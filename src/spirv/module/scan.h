// What is known of a module without taking it apart.
#pragma once

#include <cstdint>
#include <span>

#include "core/ray_flags.h"

namespace vellum::spirv
{

// What is known of all rays that a module traces in pipelines.
struct TracedFlags {
    bool traces = false;
    uint32_t fixed = shared::kHiddenRayFlags; // those that all rays have alike
    uint32_t constant = 0;                    // the fixed ones that all rays have
    uint32_t mostStride = 0;                  // the greatest SBT stride; 15 where one is unknown
    void add(const TracedFlags &other);
    bool operator==(const TracedFlags &) const = default;
};

// What one look at a module finds. Of what is not SPIR-V, nothing is known.
struct ModuleScan {
    bool hasStages = false;  // an entry point is a stage of ray tracing pipelines
    bool tracesRays = false; // it has such a stage, or declares a capability to trace rays
    TracedFlags traced;      // by its stages
};
ModuleScan scan(std::span<const uint32_t> words);

} // namespace vellum::spirv
