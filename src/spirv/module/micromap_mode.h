// SPDX-License-Identifier: Apache-2.0
// The execution mode OpacityMicromapIdKHR (SPV_KHR_opacity_micromap) of compiled modules: with VK_KHR_opacity_micromap
// alone, ray queries use micromaps only in entry points that have it, with a true operand. Some compilers cannot
// express it, and shaders forget it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "spirv/module/module.h"

namespace vellum::spirv
{

inline constexpr const char *kKhrExtension = "SPV_KHR_opacity_micromap";
inline constexpr const char *kExtExtension = "SPV_EXT_opacity_micromap";

// How an entry point declares whether its ray queries use micromaps.
struct MicromapMode {
    enum class When {
        Absent,      // no execution mode: never
        Never,       // false
        Always,      // true
        Specialized, // a specialization constant
        Computed,    // an expression of specialization constants
        Invalid      // the operand is not a constant of type bool, or there are two different ones
    };
    When when = When::Absent;
    uint32_t constantId = 0; // SpecId, for Specialized
    bool initial = false;    // default value, for Specialized
    bool operator==(const MicromapMode &) const = default;
};

// OpExecutionMode or OpExecutionModeId with OpacityMicromapIdKHR.
bool isMicromapMode(Words instruction);

// The execution modes of a module, in its order.
struct DeclaredMode {
    Id function = 0; // of the entry point
    Id operand = 0;  // 0 if it has none that is an id
};
std::vector<DeclaredMode> declaredModes(const Module &module);

// The meaning of an execution mode's operand.
MicromapMode micromapMode(const Module &module, Id operand);

struct EntryPoint {
    std::string name;
    uint32_t model = 0; // SPIR-V's execution model
    Id function = 0;
    bool queries = false; // it has ray queries, itself or in functions that it calls
    bool traces = false;  // it traces rays of a ray tracing pipeline
    MicromapMode mode;
};

// Nothing for words that Module::parse rejects; sets `error`. Reads nothing outside `words`.
std::optional<std::vector<EntryPoint>> readEntryPoints(std::span<const uint32_t> words, std::string &error);

struct ModeEdit {
    enum class To {
        Always,      // the mode, with the constant true
        Specialized, // the mode, with a specialization constant
        Absent       // no mode
    };
    To to = To::Always;
    uint32_t constantId = 0; // SpecId, for Specialized. A constant of the module that has it is used.
    bool initial = false;    // its default
    // Names of the entry points to edit. Empty: all, and those that get the mode only if they have ray queries.
    std::vector<std::string> entryPoints;
};

struct ModeResult {
    std::vector<uint32_t> words; // empty if nothing changes, or on failure
    std::string error;           // empty on success
};

// Gives entry points the mode, in place of one that they have, or removes it; the capability and the extension come and
// go with it. The result is valid if the module is. Reads nothing outside `words` and throws nothing but
// std::bad_alloc.
ModeResult editMicromapMode(std::span<const uint32_t> words, const ModeEdit &edit);

} // namespace vellum::spirv
