// SPDX-License-Identifier: Apache-2.0
// The command line as the manual page and the completions of shells need it, from the declarations that parse it.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

struct ReferenceOption {
    std::vector<std::string> names; // "-m", "--mode"; of a positional argument none
    std::string value;              // what it takes: "WxH"; empty for a flag
    std::vector<std::string> words; // the values that it takes, if these are all
    std::string description;
    bool positional = false;
    bool folder = false; // takes a folder
};

struct ReferenceGroup {
    std::string name; // "Output"
    std::vector<ReferenceOption> options;
};

struct ReferenceCommand {
    std::string name; // "render"; empty for the command itself
    std::string usage;
    std::string description;
    std::string details; // as --help prints them below the options
    std::vector<ReferenceGroup> groups;

    [[nodiscard]] std::vector<ReferenceOption> options() const; // of all groups
};

// The command itself first, then its subcommands in their order.
std::vector<ReferenceCommand> readCommands();

} // namespace vellum::cli
