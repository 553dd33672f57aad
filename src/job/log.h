// SPDX-License-Identifier: Apache-2.0
// The log of a job over many files: a JSON object in a line for each file that has ended. Logs are merged by `cat`, in
// any order, and a line that a killed process or a full disk cut off is ignored.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "base/files.h"

namespace vellum::job
{

inline constexpr const char *kBaked = "baked";
inline constexpr const char *kUnchanged = "unchanged";
inline constexpr const char *kRemoved = "removed";
inline constexpr const char *kFailed = "failed";

struct LogLine {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string status;
    std::string options; // a digest of those that matter
    uint64_t bytes = 0;  // of the input
    // What was written, the files that the output names included, with their sizes.
    std::vector<std::pair<std::filesystem::path, uint64_t>> files{};
    uint64_t milliseconds = 0;
    std::string message; // empty if there is nothing to say
};

class Log
{
public:
    // Creates the file if there is none. Throws Error, also for a file that is not a log.
    explicit Log(const std::filesystem::path &path);
    // Adds a line with the time. May be called from any thread. Throws Error.
    void add(const LogLine &line);

private:
    std::mutex adding_;
    bool inLine_; // the last line is cut off
    AppendedFile file_;
};

// What logs have as done: the newest line of an input and output is not a failure and has the same options, and the
// input has the size that it had then, and all that was written is there still, with its size.
class DoneFiles
{
public:
    // `options`: LogLine::options of this run.
    explicit DoneFiles(std::string options) : options_(std::move(options)) {}

    // Adds the lines of a log. Throws Error if it cannot be read or is not a log.
    void add(const std::filesystem::path &log);
    [[nodiscard]] bool empty() const { return files_.empty(); }
    // Returns whether there is a line of them.
    [[nodiscard]] bool names(const std::filesystem::path &input, const std::filesystem::path &output) const;
    [[nodiscard]] bool contains(const std::filesystem::path &input, const std::filesystem::path &output) const;
    // Returns whether it would be done if the options were the same.
    [[nodiscard]] bool hasOtherOptions(const std::filesystem::path &input, const std::filesystem::path &output) const;

private:
    struct State {
        std::string time;
        std::string options;
        uint64_t bytes = 0; // of the input
        bool done = false;
        std::vector<std::pair<std::filesystem::path, uint64_t>> written;
    };
    // Locations.
    using Names = std::pair<std::filesystem::path, std::filesystem::path>;
    struct NamesOrder {
        bool operator()(const Names &a, const Names &b) const;
    };

    [[nodiscard]] const State *find(const std::filesystem::path &input, const std::filesystem::path &output) const;
    static bool isDone(const std::filesystem::path &input, const State &state);

    std::string options_;
    std::map<Names, State, NamesOrder> files_;
};

} // namespace vellum::job
