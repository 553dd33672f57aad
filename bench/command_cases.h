// SPDX-License-Identifier: Apache-2.0
// The commands that the layer intercepts and that need no work of its own, each as a loop of so many calls.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "command_sides.h"

namespace vellum::bench
{

struct CommandCase {
    std::string name;
    // Calls the command `count` times; those that are recorded, into `commands`. What objects it makes it destroys.
    std::function<void(const CommandSide &, VkCommandBuffer commands, uint32_t count)> run;
    // The case creates pipelines or shader modules, which takes a driver long: fewer are made.
    bool creation = false;
    // Returns whether a side has the case.
    std::function<bool(const CommandSide &)> available = [](const CommandSide &) { return true; };
};

std::vector<CommandCase> commandCases();

} // namespace vellum::bench
