// SPDX-License-Identifier: Apache-2.0
// Files, standard streams and terminals as the system knows them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace vellum
{

// Identifies a file by whichever of its names.
using FileId = std::pair<uint64_t, uint64_t>;
// Nothing if the file does not exist.
std::optional<FileId> idOf(const std::filesystem::path &path);

// One name for each location in the file system, whether there is something or not. A link at the location is not
// followed, as a write replaces it.
std::filesystem::path locationOf(const std::filesystem::path &path);

// Orders locations; equal are those that the system takes for one, which on Windows does not distinguish case.
struct LocationOrder {
    bool operator()(const std::filesystem::path &a, const std::filesystem::path &b) const;
};

// The bytes that new files in a folder that exists can have together, as far as is known: 0 also where there can be no
// other file.
uint64_t freeBytes(const std::filesystem::path &folder);

// Why no file can be made in a folder that exists; empty where one can, as far as is known.
std::string problemOfFolder(const std::filesystem::path &folder);

// A new file, empty at first, that is removed with this object.
class TemporaryFile
{
public:
    // Throws Error.
    TemporaryFile();
    ~TemporaryFile();
    TemporaryFile(const TemporaryFile &) = delete;
    TemporaryFile &operator=(const TemporaryFile &) = delete;

    [[nodiscard]] const std::filesystem::path &path() const { return path_; }

private:
    std::filesystem::path path_;
};

// A file that several processes append to.
class AppendedFile
{
public:
    // Creates the file if there is none. Throws Error.
    explicit AppendedFile(const std::filesystem::path &path);
    ~AppendedFile();
    AppendedFile(const AppendedFile &) = delete;
    AppendedFile &operator=(const AppendedFile &) = delete;

    // Appends all of it by one call of the system, so that nothing of another process gets between. Throws Error where
    // not all of it was written.
    void append(std::string_view text);

private:
    std::filesystem::path path_;
    intptr_t file_ = -1; // the system's
};

bool isTerminal(std::FILE *stream);
// The width of the terminal that stdout is; nothing if it is not a terminal.
std::optional<size_t> terminalWidth();

// Another stream to the same file as stdout, which child processes do not inherit. Null if it cannot be created.
std::FILE *duplicateStdout();
// Redirects stdout to stderr from now on. Returns false if that is not possible.
bool sendStdoutToStderr();
// Discards the output to stdout from now on. Returns false if that is not possible.
bool discardStdout();

// Returns whether an operand, "-", stands for stdin, or as an output for stdout.
inline bool isStandardStream(const std::filesystem::path &path)
{
    return path == "-";
}

// Discards what is printed to stdout from now on, and shows no progress.
void discardReports();

// Keeps stdout for data: what is printed to it from now on goes to stderr or is discarded.
class DataOutput
{
public:
    enum class Reports { ToStderr, Discarded };
    explicit DataOutput(Reports reports);
    // Throws Error.
    void write(std::span<const uint8_t> bytes);
    void write(std::string_view text) { write({reinterpret_cast<const uint8_t *>(text.data()), text.size()}); }
    // Flushes the output to stdout. Throws Error.
    void finish();

private:
    std::unique_ptr<std::FILE, int (*)(std::FILE *)> file_;
};

} // namespace vellum
