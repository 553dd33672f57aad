// The command line as the manual page and the completions of shells need it, from the declarations that parse it.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

struct ReferenceOption {
    std::vector<std::string> names; // "-m", "--mode"; of a positional argument none
    std::string value;              // what it takes: "WxH"; empty for a flag
    std::vector<std::string> words; // that it takes, where these are all
    std::string description;        // its lines joined
    bool positional = false;
    bool folder = false; // takes a folder
    bool many = false;   // may be there several times
};

struct ReferenceCommand {
    std::string name; // "render"; empty for what comes before a subcommand
    std::string description;
    std::string details; // as --help prints them below the options
    std::vector<ReferenceOption> options;
};

// The command itself first, then its subcommands in their order.
std::vector<ReferenceCommand> readCommands();

} // namespace vellum::cli
