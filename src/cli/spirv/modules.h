// SPDX-License-Identifier: Apache-2.0
// SPIR-V modules of `vellum spirv`: files and streams of them, their stages, what has no effect or cannot work in them,
// and the reports: text, and JSON by schema.json.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "spirv/module/micromap_mode.h"
#include "spirv/rewrite.h"

namespace vellum::cli
{

// Reads a module, from stdin for "-", and checks its structure. Throws Error.
std::vector<uint32_t> readModule(const std::filesystem::path &path);

// The error in the structure of a module; empty if it is valid.
std::string structureError(std::span<const uint32_t> words);

inline std::span<const uint8_t> bytesOf(std::span<const uint32_t> words)
{
    return {reinterpret_cast<const uint8_t *>(words.data()), words.size_bytes()};
}

// "compute", "any-hit"
std::string stageName(uint32_t model);

// The way in which a shader is rewritten in a ray tracing pipeline that uses micromaps.
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

struct SpirvOutput {
    std::string path;
    size_t bytes = 0;
    bool changed = false;
};

// A module, as it is after the change.
struct SpirvFile {
    std::string path;
    std::string error; // why it was not read or changed; nothing else is known then
    size_t bytes = 0;
    uint32_t version = 0; // from the header of the module
    std::vector<spirv::EntryPoint> entryPoints;
    std::optional<std::vector<LintFinding>> findings; // of --lint
    std::optional<SpirvOutput> output;
};

void printSpirv(const SpirvFile &file);
std::string spirvJson(const char *action, std::span<const SpirvFile> files);

} // namespace vellum::cli
