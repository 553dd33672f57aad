// SPDX-License-Identifier: Apache-2.0
// A file that is written under no name, or a hidden one, and then gets its name. Each system does that in its own way.
// Every function throws GltfError, with the path in front; GltfStorageError where no file can be written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace vellum
{

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
