// SPDX-License-Identifier: Apache-2.0
// Calls from JavaScript: what bindings/js/index.js calls and is called for, the options that it passes and the results
// that it gets. Numbers that may have 64 bits are doubles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "vellum/vellum.h"

#define VELLUM_EXPORT(name) extern "C" __attribute__((export_name(name)))

// Callbacks of the call that runs. They return other than 0 to cancel it.
extern "C" {
__attribute__((import_module("vellum"), import_name("progress"))) int vellumProgressOfCall(double done, double total);
__attribute__((import_module("vellum"), import_name("cancelled"))) int vellumCancelledOfCall();
}

namespace vellum::wasm
{

// A text, which is the message of an error or else JSON, and parts: bytes that the JSON names by their numbers.
// JavaScript holds the address of its first member.
struct Result {
    // As JavaScript reads it: words of 32 bits, addresses among them.
    struct Words {
        int32_t code;
        const char *text;
        size_t textSize;
        struct Part {
            const void *bytes;
            size_t size;
        };
        const Part *parts;
        size_t partCount;
    };

    Words words{};
    std::string text;
    std::vector<Words::Part> parts;
    std::shared_ptr<void> owner; // of the parts

    // Returns its number.
    size_t add(const void *bytes, size_t size)
    {
        parts.push_back({bytes, size});
        return parts.size() - 1;
    }
};

// Runs the body of an export, which returns what it made or true. Returns 0 if memory runs out: no exception reaches
// JavaScript.
template <typename Function>
auto guardedExport(Function &&function) noexcept -> decltype(function())
{
    try {
        return function();
    } catch (const std::bad_alloc &) {
        return {};
    }
}

// The message callback of a call; userData is its Result.
void keepMessage(void *result, VellumResult code, const char *message);

// Completes the result of a call. JavaScript destroys it.
const Result::Words *finish(std::unique_ptr<Result> result, int32_t code);

// The options of a bake. `numbers`: the members of VellumBakeOptions in the order of kOptions in bindings/js/index.js,
// NaN for a default. The callbacks are those of index.js, with one thread.
VellumBakeOptions optionsOf(const double *numbers, Result &result);

// Usage counts as JSON, of VellumMicromapUsage or MicromapUsage.
template <typename Usage>
void writeUsages(JsonWriter &json, std::span<const Usage> usages)
{
    json.list("usages", usages, [&](const Usage &usage) {
        json.beginObject().member("count", usage.count).member("subdivisionLevel", usage.subdivisionLevel);
        json.member("format", static_cast<uint32_t>(usage.format)).end();
    });
}

} // namespace vellum::wasm
