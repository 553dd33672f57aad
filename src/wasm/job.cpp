// SPDX-License-Identifier: Apache-2.0
#include "wasm/job.h"

#include <cmath>

#include "wasm/exports.h"

namespace vellum::wasm
{
namespace
{

// JavaScript has checked that integers are integers of this size.
template <typename Number>
void take(const double *&next, Number &member)
{
    const double given = *next++;
    if (!std::isnan(given))
        member = static_cast<Number>(given);
}

} // namespace

VellumBakeOptions optionsOf(const double *numbers, Result &result)
{
    VellumBakeOptions options;
    vellumInitBakeOptions(&options, sizeof options);
    const double *next = numbers;
    take(next, options.format);
    take(next, options.twoStateRule);
    take(next, options.level);
    take(next, options.maxLevel);
    take(next, options.texelsPerEdge);
    take(next, options.compareOp);
    take(next, options.flags);
    take(next, options.budget);
    take(next, options.minKnown);
    take(next, options.valueTolerance);
    take(next, options.subtexelTolerance);
    take(next, options.barycentricTolerance);
    take(next, options.interpolationTolerance);
    take(next, options.maxDataSize);
    options.threads = 1;
    options.message = keepMessage;
    options.progress = [](void *, uint64_t done, uint64_t total) {
        return vellumProgressOfCall(static_cast<double>(done), static_cast<double>(total));
    };
    options.cancelled = [](void *) { return vellumCancelledOfCall(); };
    options.userData = &result;
    return options;
}

} // namespace vellum::wasm
