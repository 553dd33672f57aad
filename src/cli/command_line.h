// The command line: which subcommands there are.
#pragma once

namespace vellum::cli
{

// Parses the command line and runs the command it names. Prints what --help and --version ask for. Returns the
// process's exit code; throws Error, GltfError or BakeError.
int runCommandLine(int argc, char **argv);

} // namespace vellum::cli
