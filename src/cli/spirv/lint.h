// SPDX-License-Identifier: Apache-2.0
// What has no effect or cannot work in a module: in its use of micromaps, and where they are emulated.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "spirv/module/micromap_mode.h"

namespace vellum::cli
{

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
