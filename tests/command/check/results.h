// SPDX-License-Identifier: Apache-2.0
// Runs `vellum check` with the groups of fake_groups.cpp, and reads its results.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "command.h"
#include "glb_file.h"

namespace vellum::test
{

using Environment = std::vector<std::pair<std::string, std::string>>;

// How reports name the end of a process by crash() and by std::abort().
#ifdef _WIN32
inline const std::string kCrash = "access violation (0xC0000005)";
inline const std::string kAbort = "exit code 3";
#else
inline const std::string kCrash = "SIGSEGV";
inline const std::string kAbort = "SIGABRT";
#endif

struct CheckRun {
    Outcome outcome;
    std::map<std::string, std::string> results;  // results.csv: status by name
    std::map<std::string, std::string> failures; // failures.csv
};

// The lines of a file; empty if the file does not exist.
std::vector<std::string> linesOf(const std::filesystem::path &path);
std::string textOf(const std::filesystem::path &path);
void writeFile(const std::filesystem::path &path, const std::string &text);
// NAME,STATUS[,SECONDS]
std::map<std::string, std::string> statusesIn(const std::filesystem::path &path);

// Writes to folder / "out".
CheckRun runCheck(const TemporaryFolder &folder, std::vector<std::string> arguments,
                  const Environment &environment = {});

} // namespace vellum::test
