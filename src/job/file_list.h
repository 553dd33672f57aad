// SPDX-License-Identifier: Apache-2.0
// The files of a job over many files: their list, as programs write it, `INPUT` or `INPUT<TAB>OUTPUT` in each line, and
// what outputs depend on, for Make and Ninja.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vellum::job
{

struct ListedFile {
    size_t line = 0; // from 1
    std::filesystem::path input;
    std::optional<std::filesystem::path> output;
};

// Lines may end in CR LF; empty ones are ignored, as is a byte order mark. `name`: of the list. Throws UsageError, with
// the number of the line.
std::vector<ListedFile> parseFileList(const std::string &text, const std::string &name);

// The error of a line.
std::string lineError(const std::string &name, size_t line, const std::string &what);

// A rule of a depfile, escaped as compilers do it, and one without dependencies for each dependency, so that Make goes
// on where one no longer exists. Throws Error for a name that the syntax cannot express.
std::string depfileRule(const std::filesystem::path &output, const std::vector<std::filesystem::path> &dependencies);

} // namespace vellum::job
