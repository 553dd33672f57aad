// SPDX-License-Identifier: Apache-2.0
// The outline of a module, read in one pass over its words: what the execution mode OpacityMicromapIdKHR depends on,
// and where declarations of it belong.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "spirv/module/words.h"

namespace vellum::spirv
{

// Opcodes that an outline is made of. libvellum is built without SPIR-V headers.
enum class Op : uint32_t {
    SourceContinued = 2,
    Source = 3,
    SourceExtension = 4,
    Name = 5,
    MemberName = 6,
    String = 7,
    Line = 8,
    Extension = 10,
    ExtInstImport = 11,
    MemoryModel = 14,
    EntryPoint = 15,
    ExecutionMode = 16,
    Capability = 17,
    TypeBool = 20,
    ConstantTrue = 41,
    ConstantFalse = 42,
    ConstantNull = 46,
    SpecConstantTrue = 48,
    SpecConstantFalse = 49,
    SpecConstantOp = 52,
    Function = 54,
    FunctionCall = 57,
    Decorate = 71,
    MemberDecorate = 72,
    DecorationGroup = 73,
    GroupDecorate = 74,
    GroupMemberDecorate = 75,
    NoLine = 317,
    ModuleProcessed = 330,
    ExecutionModeId = 331,
    DecorateId = 332,
    TraceRayKHR = 4445,
    RayQueryInitializeKHR = 4473,
    DecorateString = 5632,
    MemberDecorateString = 5633,
};
inline constexpr uint32_t kDecorationSpecId = 1;
inline constexpr const char *kKhrExtension = "SPV_KHR_opacity_micromap";
inline constexpr const char *kExtExtension = "SPV_EXT_opacity_micromap";

// OpExecutionMode or OpExecutionModeId with OpacityMicromapIdKHR.
bool isMicromapMode(Words instruction);

struct Outline {
    struct EntryPoint {
        std::string name;
        uint32_t model = 0;
        uint32_t function = 0;
    };
    struct Mode {
        uint32_t function = 0;
        uint32_t operand = 0; // 0 if it has none that is an id
    };
    struct Function {
        std::set<uint32_t> callees;
        bool queries = false; // it initializes a ray query
        bool traces = false;  // it traces a ray of a pipeline
    };

    std::vector<EntryPoint> entryPoints;
    std::vector<Mode> modes; // OpacityMicromapIdKHR
    std::map<uint32_t, Function> functions;
    std::map<uint32_t, Op> booleans; // constants of type bool
    std::map<uint32_t, uint32_t> specIds;
    uint32_t boolType = 0; // 0: there is none
    bool hasModeCapability = false;
    bool hasFlagCapability = false; // of the ray flag ForceOpacityMicromap2State
    bool hasKhr = false;            // SPV_KHR_opacity_micromap
    bool hasExt = false;            // SPV_EXT_opacity_micromap

    // Where to insert: after all capabilities, extensions, execution modes and decorations, and before the functions.
    size_t capabilities = 0, extensions = 0, executionModes = 0, decorations = 0, globals = 0;

    // The functions that have the property, and those that call them, directly or through others.
    [[nodiscard]] std::set<uint32_t> reaching(bool Function::*property) const;

    // Nothing if the words are malformed in what is read here; sets `error`.
    static std::optional<Outline> read(Words words, std::string &error);
};

} // namespace vellum::spirv
