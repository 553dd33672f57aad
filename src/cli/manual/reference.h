// SPDX-License-Identifier: Apache-2.0
// The manual pages and the completions of shells, made from the declarations that parse the command line.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

struct ReferenceOption {
    std::vector<std::string> names; // "-m", "--mode"; of a positional argument none
    std::string value;              // the operand: "WxH"; empty for a flag
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
    std::string details; // printed by --help below the options
    std::vector<ReferenceGroup> groups;

    [[nodiscard]] std::vector<ReferenceOption> options() const; // of all groups
};

// The command itself first, then its subcommands in their order.
std::vector<ReferenceCommand> readCommands();

std::string bashCompletion(const std::vector<ReferenceCommand> &commands);
std::string zshCompletion(const std::vector<ReferenceCommand> &commands);
std::string fishCompletion(const std::vector<ReferenceCommand> &commands);

struct ManEdition {
    std::string version;
    std::string date; // 2026-01-31
};

// vellum.1
std::string manPage(const std::vector<ReferenceCommand> &commands, const ManEdition &edition);
// vellum-bake.1 and so on: of commands[number].
std::string manPageOf(const std::vector<ReferenceCommand> &commands, size_t number, const ManEdition &edition);

} // namespace vellum::cli
