// SPDX-License-Identifier: Apache-2.0
#include "wasm/result.h"

#include <cstddef>
#include <new>

#include "wasm/exports.h"

namespace vellum::wasm
{

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
