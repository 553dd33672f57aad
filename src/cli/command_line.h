// SPDX-License-Identifier: Apache-2.0
// The command line: which subcommands there are.
#pragma once

#include <functional>
#include <map>
#include <string>

namespace CLI
{
class App;
}

namespace vellum::cli
{

// Adds all subcommands and their options. Returns what runs each of them.
std::map<std::string, std::function<int()>> declareCommands(CLI::App &app);

// Parses the command line and runs the command it names. Prints what --help and --version ask for. Returns the
// process's exit code; throws Error, GltfError or BakeError.
int runCommandLine(int argc, char **argv);

} // namespace vellum::cli
