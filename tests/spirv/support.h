// SPDX-License-Identifier: Apache-2.0
// Shared by the rewriter's tests: shaders, SPIR-V Tools, and a summary of rewritten modules.
#pragma once

#include "spirv/module/scan.h"
#include "spirv/rewrite.h"
#include "validate.h"

#include <spirv-tools/libspirv.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace vellum::test
{

// Values of spirv::HiddenFlags::fixed: all rays have the same hidden flags, or each ray's are in its payload.
inline constexpr uint32_t kAllFixed = spirv::HiddenFlags{}.fixed, kNoneFixed = 0;

// A shader of shaders/ as CMakeLists.txt compiled it: "while_loop.comp", "v15".
Module loadShader(const std::string &name, const std::string &variant);

// spirv-opt -O.
Module optimize(const Module &words);

Module assemble(const std::string &text);
std::string disassemble(const Module &words);

// Expects that the rewritten module has the same version, and needs only capabilities and extensions that the original
// needs or that the layer enables on every device.
void expectNoMoreNeeds(const Module &words, const Module &rewritten);

// Rewrites the module twice, with constant ray flags folded and with them preserved like others, and expects a valid
// Rewritten module both times. Returns the first.
Module rewriteValid(const Module &words);

size_t count(const std::string &text, const std::string &part);

// Counts how the proceed calls of a rewritten module were handled.
struct Forms {
    size_t proceedFunctions = 0;   // vellumProceed functions, one for each way to reach a query
    size_t candidateFunctions = 0; // vellumCandidate functions
    size_t innerCalls = 0;         // proceed calls that became a call of vellumProceed
    size_t flatCalls = 0;          // proceed calls that stayed
};
Forms formsOf(const Module &rewritten);

// A compute module around assembly: %main's body after its first label, with a Function variable %q and an initialized
// query. `globals` and `functions` are added at their places. See support.cpp for the names in reach.
std::string moduleText(const std::string &body, const std::string &globals = "", const std::string &functions = "");

// A module of ray tracing stages: `declarations` are its entry points, names and decorations, `body` the types,
// variables and functions. %void and %proc, the type of a function without parameters, are declared before them.
std::string rayTracingText(const std::string &declarations, const std::string &body,
                           const std::string &needs = "OpCapability RayTracingKHR\n");

// A function of that type; `code` stands between its first label and its OpReturn.
std::string functionText(const std::string &name, const std::string &code = "");

} // namespace vellum::test
