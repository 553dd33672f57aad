// SPDX-License-Identifier: Apache-2.0
// Files as the system knows them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace vellum::cli
{

// The same for all names of a file.
using FileId = std::pair<uint64_t, uint64_t>;
// Nothing where there is no file.
std::optional<FileId> idOf(const std::filesystem::path &path);

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

// A text that processes which this one starts can read from a file as long as this object exists.
class SharedText
{
public:
    // Throws Error.
    explicit SharedText(std::string_view text);
    ~SharedText();
    SharedText(const SharedText &) = delete;
    SharedText &operator=(const SharedText &) = delete;

    [[nodiscard]] const std::filesystem::path &path() const { return path_; }

private:
    std::filesystem::path path_;
    int descriptor_ = -1;
};

} // namespace vellum::cli
