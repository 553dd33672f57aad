// SPDX-License-Identifier: Apache-2.0
// The results of calls from JavaScript.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "vellum/vellum.h"

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

} // namespace vellum::wasm
