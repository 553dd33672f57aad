// SPDX-License-Identifier: Apache-2.0
// A folder of values by their keys, which many processes on many machines may share. It takes bounded space: the values
// that were not used for the longest time are removed.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/sha256.h"

namespace vellum
{

// Each value is a file, in one of 64 folders by its key. Files appear whole by getting their name last, and nothing is
// locked: a reader finds a whole value or none, a process that is killed leaves at most a file without a key, which is
// removed like the others, and of two that write a value either remains. Keys are digests, so the folders fill evenly,
// and each keeps to its part of the size. The time of a file is that of its last use.
//
// A value that cannot be read is not there, and one that cannot be written is not kept. May be used by any number of
// threads.
class CacheFolder
{
public:
    static constexpr size_t kFolders = 64;

    // Uses the folder `micromaps` in `folder`; both are made for the first value. `size`: bytes, of blocks of 4 KiB.
    CacheFolder(const std::filesystem::path &folder, uint64_t size);

    // Whether the value is what was put is for the caller to check.
    std::optional<std::vector<uint8_t>> get(const Digest &key);
    // Replaces an earlier value. One that takes more than a folder's part of the size is not kept. After a failure no
    // value is.
    void put(const Digest &key, std::span<const uint8_t> value);

    // The first reason why a value could not be read or written; empty if there was none.
    [[nodiscard]] std::string problem() const;

private:
    [[nodiscard]] size_t numberOf(const Digest &key) const;
    [[nodiscard]] std::filesystem::path folderOf(size_t number) const;
    void note(const std::string &problem);
    void removeOldest(size_t number);

    std::filesystem::path folder_;
    uint64_t part_; // of the size, for each folder
    mutable std::mutex mutex_;
    std::string problem_;
    bool writing_ = true;
    // For each folder, bytes that were put since it was counted. They begin anywhere, so that of processes that put one
    // value each some count as well.
    std::array<uint64_t, kFolders> unchecked_;
};

} // namespace vellum
