// SPDX-License-Identifier: Apache-2.0
// The manual pages, in the man macros of roff.
#pragma once

#include "cli/manual/commands_of.h"

namespace vellum::cli
{

struct ManEdition {
    std::string version;
    std::string date; // 2026-01-31
};

// vellum.1
std::string manPage(const std::vector<ReferenceCommand> &commands, const ManEdition &edition);
// vellum-bake.1 and so on: of commands[number].
std::string manPageOf(const std::vector<ReferenceCommand> &commands, size_t number, const ManEdition &edition);

} // namespace vellum::cli
