// SPDX-License-Identifier: Apache-2.0
// Completions for shells.
#pragma once

#include "cli/manual/commands_of.h"

namespace vellum::cli
{

std::string bashCompletion(const std::vector<ReferenceCommand> &commands);
std::string zshCompletion(const std::vector<ReferenceCommand> &commands);
std::string fishCompletion(const std::vector<ReferenceCommand> &commands);

} // namespace vellum::cli
