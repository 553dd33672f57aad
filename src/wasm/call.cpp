// SPDX-License-Identifier: Apache-2.0
#include "wasm/call.h"

#include <cmath>

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

void keepMessage(void *result, VellumResult, const char *message)
{
    try {
        static_cast<Result *>(result)->text = message;
    } catch (const std::bad_alloc &) { // a callback must not throw; the code remains
    }
}

const Result::Words *finish(std::unique_ptr<Result> result, int32_t code)
{
    Result &made = *result.release();
    made.words = {code, made.text.data(), made.text.size(), made.parts.data(), made.parts.size()};
    return &made.words;
}

} // namespace vellum::wasm

using namespace vellum::wasm;

// The words are the first member.
VELLUM_EXPORT("destroyResult") void vellumDestroyResultOfCall(Result::Words *words)
{
    delete reinterpret_cast<Result *>(words);
}

VELLUM_EXPORT("version") uint32_t vellumVersionOfModule()
{
    return vellumGetVersion();
}

VELLUM_EXPORT("bakeVersion") uint32_t vellumBakeVersionOfModule()
{
    return vellumGetBakeVersion();
}

VELLUM_EXPORT("resultName") const char *vellumNameOfResult(int32_t code)
{
    return vellumResultName(static_cast<VellumResult>(code));
}
