// SPDX-License-Identifier: Apache-2.0
// Lists of files to work on, as programs write them: `INPUT` or `INPUT<TAB>OUTPUT` in each line.
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

} // namespace vellum::job
