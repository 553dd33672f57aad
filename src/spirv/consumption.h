// Which ray queries consume micromaps: what the entry points declare by the OpacityMicromapIdKHR execution mode
// (SPV_KHR_opacity_micromap), seen from the functions that they reach.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "spirv/module/code.h"
#include "spirv/module/types.h"
#include "spirv/rewrite.h"

namespace vellum::spirv
{

// Of the ray queries of a function.
struct Consumes {
    enum class When {
        Never,
        Always,
        If,   // the constant `condition` is true; specialization may still change it
        Mixed // entry points that reach the function declare different things
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
    // Whether any entry point declares something, be it that its queries consume none.
    [[nodiscard]] bool anyDeclared() const { return anyDeclared_; }

    [[nodiscard]] Consumes in(Id function) const;
    // The condition of a function that is not Never or Always.
    Id condition(const Consumes &consumes, Code &out);
    // Call when all functions are rewritten: has entry points say what they declare to the functions that they share
    // with others. False with error() set on failure.
    bool finish();

private:
    std::optional<Consumes> declared(Instruction mode);
    void spread();

    Module &module_;
    Types &types_;
    Consumes otherwise_{Consumes::When::Always}; // of functions that no entry point is known to reach
    std::map<Id, Consumes> entries_;             // by the entry point's function
    std::map<Id, Consumes> functions_;           // of those that entry points reach
    bool anyDeclared_ = false;
    Id variable_ = 0; // Private: what the running entry point declares; 0: nobody asked
    std::string error_;
};

} // namespace vellum::spirv
