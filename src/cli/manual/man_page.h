// The manual page.
#pragma once

#include "cli/manual/commands_of.h"

namespace vellum::cli
{

// In the man macros of roff. `date` as 2026-01-31.
std::string manPage(const std::vector<ReferenceCommand> &commands, const std::string &version, const std::string &date);

} // namespace vellum::cli
