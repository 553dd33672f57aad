// SPDX-License-Identifier: Apache-2.0
// Files that appear whole, or not at all.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "gltf/file/open_file.h"

namespace vellum
{

// Bytes to write: own ones, and those of an owner that outlives this.
class FileContent
{
public:
    void add(std::span<const uint8_t> bytes) { pieces_.push_back(bytes); }
    void add(std::string_view text) { add({reinterpret_cast<const uint8_t *>(text.data()), text.size()}); }
    void keep(std::vector<uint8_t> bytes) { add(kept_.emplace_back(std::move(bytes))); }
    [[nodiscard]] const std::vector<std::span<const uint8_t>> &pieces() const { return pieces_; }
    [[nodiscard]] uint64_t size() const;

private:
    std::deque<std::vector<uint8_t>> kept_;
    std::vector<std::span<const uint8_t>> pieces_;
};

// Returns whether both can be read and are the same file or have the same bytes.
bool sameBytes(const std::filesystem::path &a, const std::filesystem::path &b);

class OutputFiles
{
public:
    // `cancelled` is called repeatedly; BakeCancelled is thrown once it returns true.
    explicit OutputFiles(std::function<bool()> cancelled) : cancelled_(std::move(cancelled)) {}
    ~OutputFiles();
    OutputFiles(const OutputFiles &) = delete;
    OutputFiles &operator=(const OutputFiles &) = delete;

    // Writes a file that takes the place of whatever is at `path` when publish() is called. Folders are made. Throws
    // GltfError, with the path in front. Until then nothing can be seen of the file; on file systems that cannot do
    // that, a hidden temporary file.
    void write(const std::filesystem::path &path, const FileContent &content);
    // Writes a file that is never replaced: one that is there already, then or when publish() is called, must have the
    // same bytes. GltfError otherwise.
    void writeOnce(const std::filesystem::path &path, const FileContent &content);
    // Copies a file that `model` names. Throws GltfError if a link leads out of its folder (InputFile::requireBeside),
    // or if a file at `to` has other bytes and must not be replaced.
    void copy(const std::filesystem::path &from, const std::filesystem::path &to, const std::filesystem::path &model,
              bool replace = false);
    // Lets the files appear, in the order in which they were written: the file that names the others is the last one.
    // Where that fails those that have appeared stay: the outputs of other jobs, which found them there, may name them.
    void publish();

private:
    enum class Existing { Replace, Keep };
    struct Pending {
        Pending(const std::filesystem::path &path, Existing of) : file(path), existing(of) {}
        NewFile file;
        Existing existing;
    };
    void write(const std::filesystem::path &path, const FileContent &content, Existing existing);
    NewFile &open(const std::filesystem::path &path, Existing existing);
    void makeFolders(const std::filesystem::path &folder);
    void put(NewFile &file, std::span<const uint8_t> bytes) const;
    static void publish(Pending &pending);

    std::function<bool()> cancelled_;
    std::deque<Pending> pending_;
    std::vector<std::filesystem::path> folders_; // created folders
    bool published_ = false;
};

} // namespace vellum
