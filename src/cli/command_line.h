// SPDX-License-Identifier: Apache-2.0
// The command line: which subcommands there are.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace CLI
{
class App;
}

namespace vellum::cli
{

// Adds all subcommands and their options. `words`: the command line, which `vellum run` takes a program from. Returns
// what runs each of them.
std::map<std::string, std::function<int()>> declareCommands(CLI::App &app, const std::vector<std::string> &words);

// Parses the command line, without the name of the program, and runs the command it names. Prints what --help and
// --version request. Returns the process's exit code; throws Error, GltfError or BakeError.
int runCommandLine(const std::vector<std::string> &words);

} // namespace vellum::cli
