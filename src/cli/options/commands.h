// SPDX-License-Identifier: Apache-2.0
// The subcommands. Each adds itself and its options to the command line, and returns what runs it once the command line
// is parsed: a function whose result is the exit code, and which throws Error, GltfError or BakeError. `words`: the
// command line itself.
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

std::function<int()> declareBakeCommand(CLI::App &app);
std::function<int()> declareBenchCommand(CLI::App &app);
std::function<int()> declareCheckCommand(CLI::App &app);
std::function<int()> declareInfoCommand(CLI::App &app);
std::function<int()> declareInspectCommand(CLI::App &app);
std::function<int()> declareRenderCommand(CLI::App &app);
std::function<int()> declareRunCommand(CLI::App &app, const std::vector<std::string> &words);
std::function<int()> declareSpirvCommand(CLI::App &app);
std::function<int()> declareSweepCommand(CLI::App &app);
std::function<int()> declareVerifyCommand(CLI::App &app);

// Adds all subcommands and their options. `words`: the command line, which `vellum run` takes a program from. Returns
// what runs each of them.
std::map<std::string, std::function<int()>> declareCommands(CLI::App &app, const std::vector<std::string> &words);

// Parses the command line, without the name of the program, and runs the command it names. Prints what --help and
// --version request. Returns the process's exit code; throws Error, GltfError or BakeError.
int runCommandLine(const std::vector<std::string> &words);

} // namespace vellum::cli
