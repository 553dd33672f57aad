// SPDX-License-Identifier: Apache-2.0
// The lossy micromaps of a device: learned from a second, equal device, and required of every build and copy.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "check/case/built_case.h"
#include "check/oracle/cpu_trace.h"

namespace vellum::check
{

// The elements of lossy micromaps that rays meet.
struct LossyStates {
    oracle::Substitution states;
    std::map<oracle::LossyElement, std::string> faults; // violations of the specification
};

// Reads them from the structures of a case whose scene is `scene` after all steps, by ray queries or by a ray tracing
// pipeline with the parameters of the plan's first one. hits: allHits of each of its rays.
LossyStates lossyStatesIn(Device &gpu, const BuiltCase &built, const oracle::Scene &scene,
                          std::span<const oracle::Hits> hits, const TracePlan &trace = {});
// Reads them from structures that the twin of the device builds of the same data with the same flags, by plain
// commands: without copies, updates and several builds at a time.
LossyStates lossyStatesOfTwin(Device &gpu, const Case &c, const oracle::Scene &scene,
                              std::span<const oracle::Hits> hits);

// The faults of the elements that each ray meets, where the device itself has `own`, and its twin `expected`; empty:
// none.
std::vector<std::string> lossyFaults(const LossyStates &expected, const LossyStates &own,
                                     std::span<const oracle::Hits> hits);

} // namespace vellum::check
