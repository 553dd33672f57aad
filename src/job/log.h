// SPDX-License-Identifier: Apache-2.0
// The log of a job over many files: a JSON object in a line for each file that has ended. Many processes can append to
// one, logs are merged by `cat`, and a line that a killed process or a full disk cut off is ignored.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "base/files.h"

namespace vellum::job
{

inline constexpr const char *kBaked = "baked";
inline constexpr const char *kUnchanged = "unchanged";
inline constexpr const char *kFailed = "failed";
inline constexpr const char *kSkipped = "skipped"; // an earlier log has it as done

struct LogLine {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string status;
    uint64_t bytes = 0;       // of the input
    uint64_t outputBytes = 0; // 0: nothing was written
    uint64_t milliseconds = 0;
    std::string message; // empty if there is nothing to say
};

class Log
{
public:
    // Creates the file if there is none. Throws Error, also for a file that is not a log.
    explicit Log(const std::filesystem::path &path);
    // May be called from any thread. Throws Error.
    void add(const LogLine &line);

private:
    std::mutex adding_;
    bool inLine_; // the last line is cut off
    AppendedFile file_;
};

// The inputs and outputs that a log has as done: the last line of each is not a failure, and the output still exists,
// if one was written.
class DoneFiles
{
public:
    // Adds those of a log. Throws Error if it cannot be read.
    void add(const std::filesystem::path &log);
    [[nodiscard]] bool contains(const std::filesystem::path &input, const std::filesystem::path &output) const;

private:
    std::map<std::pair<std::string, std::string>, bool> files_; // and whether the output was written
};

} // namespace vellum::job
