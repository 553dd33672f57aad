// SPDX-License-Identifier: Apache-2.0
// A file that is open for reading. Each system does that in its own way. Every function throws GltfError, without the
// path.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace vellum
{

class InputFile
{
public:
    // Takes regular files only: a directory, a pipe or a device is never opened.
    explicit InputFile(const std::filesystem::path &path);
    ~InputFile();
    InputFile(const InputFile &) = delete;
    InputFile &operator=(const InputFile &) = delete;

    // Throws GltfUnsupported where the file that is open is not in the folder of `model` or below it, because a link
    // leads out of it. If the model is itself a link, as build systems make them, the folder that it leads to will do.
    void requireBeside(const std::filesystem::path &model) const;

    [[nodiscard]] uint64_t size() const { return size_; }
    // Reads as many bytes as there are left and fit. Returns their number.
    size_t read(std::span<uint8_t> bytes);

private:
    // The path without links; empty if it cannot be determined.
    [[nodiscard]] std::filesystem::path realPath() const;

    std::filesystem::path path_;
    intptr_t file_ = -1; // the system's
    uint64_t size_ = 0;
};

// A folder's path without links in it. Throws GltfError.
std::filesystem::path realFolder(const std::filesystem::path &folder);

} // namespace vellum
