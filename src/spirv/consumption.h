// SPDX-License-Identifier: Apache-2.0
// Determines the ray queries that consume micromaps. Entry points declare it by the execution mode OpacityMicromapIdKHR
// (SPV_KHR_opacity_micromap), for all functions that they reach.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "spirv/module/code.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/types.h"
#include "spirv/rewrite.h"

namespace vellum::spirv
{

// How the ray queries of a function consume micromaps.
struct Consumes {
    enum class When {
        Never,
        Always,
        If,   // the constant `condition` is true; specialization may still change it
        Mixed // the entry points that reach the function differ
    };
    When when = When::Never;
    Id condition = 0;
    bool operator==(const Consumes &) const = default;
    [[nodiscard]] bool isConditional() const { return when == When::If || when == When::Mixed; }
};

class Consumption
{
public:
    Consumption(Module &module, Types &types) : module_(module), types_(types) {}

    // Reads the execution modes, which may be removed afterwards. False with error() set if one is malformed.
    bool read(const RewriteOptions &options);
    [[nodiscard]] const std::string &error() const { return error_; }
    // Returns whether any entry point has the execution mode, even with a false operand.
    [[nodiscard]] bool anyDeclared() const { return anyDeclared_; }

    [[nodiscard]] Consumes in(Id function) const;
    // The condition in a function that is neither Never nor Always.
    Id condition(const Consumes &consumes, Code &out);
    // Call when all functions are rewritten. Entry points store their declaration for the functions that they share
    // with others. False with error() set on failure.
    bool finish();

private:
    std::optional<Consumes> declared(const DeclaredMode &mode);
    void spread();

    Module &module_;
    Types &types_;
    Consumes otherwise_{Consumes::When::Always}; // of functions that no entry point reaches
    std::map<Id, Consumes> entries_;             // by the entry point's function
    std::map<Id, Consumes> functions_;           // of those that entry points reach
    bool anyDeclared_ = false;
    Id variable_ = 0; // Private: the declaration of the running entry point; 0 until it is needed
    std::string error_;
};

} // namespace vellum::spirv
