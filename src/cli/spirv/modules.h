// SPDX-License-Identifier: Apache-2.0
// SPIR-V modules of `vellum spirv`: files and streams of them, their stages, and what has no effect or cannot work in
// them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "spirv/module/micromap_mode.h"
#include "spirv/rewrite.h"

namespace vellum::cli
{

// Reads a module, from stdin for "-", and checks its structure. Throws Error.
std::vector<uint32_t> readModule(const std::filesystem::path &path);

// What is wrong with the structure of a module; empty if nothing is.
std::string structureError(std::span<const uint32_t> words);

inline std::span<const uint8_t> bytesOf(std::span<const uint32_t> words)
{
    return {reinterpret_cast<const uint8_t *>(words.data()), words.size_bytes()};
}

// "compute", "any-hit"
std::string stageName(uint32_t model);

// What a shader is rewritten as in a ray tracing pipeline that uses micromaps.
struct PipelineRole {
    const char *name;
    uint32_t model;
    spirv::Prologue prologue;
};
std::span<const PipelineRole> pipelineRoles();

struct LintFinding {
    enum class Kind {
        QueriesWithoutMode, // ray queries that use no micromaps with VK_KHR_opacity_micromap alone
        ModeWithoutQueries, // a mode that nothing reads
        InvalidMode,        // a mode whose operand, capability or extension is missing or wrong
        Emulation,          // code that the layer rejects
        RayFlags            // ray flags that are incomplete where micromaps are emulated
    };
    Kind kind;
    std::string entryPoint; // empty: the module
    std::string message;
    bool operator==(const LintFinding &) const = default;
};

std::vector<LintFinding> lint(std::span<const uint32_t> words, std::span<const spirv::EntryPoint> entryPoints);

} // namespace vellum::cli
