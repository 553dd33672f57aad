// SPDX-License-Identifier: Apache-2.0
// Files that are open: for reading, and for writing under no name, or a hidden one, until they get their names. Each
// system does that in its own way. Every function throws GltfError: of InputFile without the path, of others with the
// path in front, and GltfStorageError where no file can be written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
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

// The folder that `path` is in; of a name alone the working directory.
std::filesystem::path folderOf(const std::filesystem::path &path);

// Makes a folder; false if it is there already.
bool makeFolder(const std::filesystem::path &folder);

// Sets the time of a file to now. It may belong to someone else, if it can be written. Does nothing where it cannot.
void markUsed(const std::filesystem::path &file);

class NewFile
{
public:
    // In the folder of `path`, which must exist.
    explicit NewFile(const std::filesystem::path &path);
    // Removes what has not got its name, which also happens if the process ends before that.
    ~NewFile();
    NewFile(const NewFile &) = delete;
    NewFile &operator=(const NewFile &) = delete;

    [[nodiscard]] const std::filesystem::path &path() const { return path_; }

    void write(std::span<const uint8_t> bytes);
    // After the last write(): the bytes are on the disk.
    void finish();
    enum class Appeared {
        New,
        Replaced, // where the file system does not state whether it replaced a file
        No,       // something has the name already
    };
    Appeared appear();
    // After appear() returned No: takes the place of what has the name. Who may read that may read this.
    void replace();
    // After appear() returned No: where its content can be read.
    [[nodiscard]] std::filesystem::path readable() const;
    // After it has got its name: so that this is on the disk as well, where the file system supports it.
    // Does not allocate: what has appeared stays.
    void syncName() const;

private:
    [[noreturn]] void fail() const; // by the system's last error
    void discard();

    std::filesystem::path path_;
    std::filesystem::path folder_;    // of path_
    std::filesystem::path temporary_; // its name, where it has one
    intptr_t file_ = -1;              // the system's
};

// Calls create(name) with random hidden names in the folder of `path` until one of them is free: create() returns
// whether it is, having made a file of it or failed otherwise. A name can be taken by a file that an earlier process
// left. Returns that name, or the last one after many.
std::filesystem::path temporaryName(const std::filesystem::path &path,
                                    const std::function<bool(const std::filesystem::path &)> &create);

} // namespace vellum
