// SPDX-License-Identifier: Apache-2.0
// The reports of `vellum spirv`: text, and JSON by schema.json.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cli/spirv/modules.h"

namespace vellum::cli
{

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
    uint32_t version = 0; // as in the header of the module
    std::vector<spirv::EntryPoint> entryPoints;
    std::optional<std::vector<LintFinding>> findings; // of --lint
    std::optional<SpirvOutput> output;
};

void printSpirv(const SpirvFile &file);
std::string spirvJson(const char *action, std::span<const SpirvFile> files);

} // namespace vellum::cli
