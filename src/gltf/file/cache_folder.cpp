// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/cache_folder.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <random>

#include "base/text.h"
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"

namespace vellum
{
namespace
{

namespace fs = std::filesystem;

constexpr uint64_t kBlock = 4096;
// Of a full folder's part, free once the oldest values are removed.
constexpr uint64_t kFreed = 10;
// Of a folder's part, what a process may put before it counts the folder's bytes: others put values as well.
constexpr uint64_t kUnchecked = 16;

// After which a file with a temporary name is one that a killed process left.
constexpr std::chrono::hours kLongestWrite{1};

#ifdef _WIN32
constexpr bool kReplacingLocks = true; // nobody opens a file while another one replaces it
#else
constexpr bool kReplacingLocks = false;
#endif

// Windows does not remove a file that somebody reads; the next who needs the room does.
bool isInUse([[maybe_unused]] const std::error_code &error)
{
#ifdef _WIN32
    constexpr int kSharingViolation = 32;
    return error.category() == std::system_category() && error.value() == kSharingViolation;
#else
    return false;
#endif
}

uint64_t onDisk(uint64_t bytes)
{
    return (bytes + kBlock - 1) / kBlock * kBlock;
}

} // namespace

CacheFolder::CacheFolder(const fs::path &folder, uint64_t size) : folder_(folder / "micromaps"), part_(size / kFolders)
{
    std::random_device device;
    std::uniform_int_distribution<uint64_t> any(0, part_ / kUnchecked);
    std::generate(unchecked_.begin(), unchecked_.end(), [&] { return any(device); });
}

size_t CacheFolder::numberOf(const Digest &key) const
{
    return key.front() % kFolders;
}

fs::path CacheFolder::folderOf(size_t number) const
{
    const auto name = static_cast<uint8_t>(number);
    return folder_ / hexOf({&name, 1});
}

void CacheFolder::note(const std::string &problem)
{
    const std::lock_guard lock(mutex_);
    if (problem_.empty())
        problem_ = problem;
}

std::string CacheFolder::problem() const
{
    const std::lock_guard lock(mutex_);
    return problem_;
}

std::optional<std::vector<uint8_t>> CacheFolder::get(const Digest &key)
{
    const fs::path path = folderOf(numberOf(key)) / hexOf(key);
    std::error_code error;
    const uintmax_t size = fs::file_size(path, error);
    if (error) {
        if (error != std::errc::no_such_file_or_directory)
            note(utf8Text(path) + " cannot be read: " + error.message());
        return std::nullopt;
    }
    if (size > part_)
        return std::nullopt;
    std::vector<uint8_t> value(static_cast<size_t>(size));
    std::ifstream file(path, std::ios::binary);
    if (!file && !kReplacingLocks && fs::exists(path, error)) // otherwise it has just been removed
        note(utf8Text(path) + " cannot be read");
    if (!file.read(reinterpret_cast<char *>(value.data()), static_cast<std::streamsize>(size)))
        return std::nullopt;
    markUsed(path);
    return value;
}

void CacheFolder::put(const Digest &key, std::span<const uint8_t> value)
{
    const uint64_t bytes = onDisk(value.size());
    const size_t number = numberOf(key);
    {
        const std::lock_guard lock(mutex_);
        if (!writing_ || bytes > part_)
            return;
    }
    const fs::path folder = folderOf(number);
    try {
        std::error_code error;
        if (fs::create_directories(folder, error); error)
            throw GltfError(utf8Text(folder) + ": the folder cannot be made: " + error.message());
        NewFile file(folder / hexOf(key));
        file.write(value);
        if (file.appear() == NewFile::Appeared::No)
            file.replace();
    } catch (const GltfError &failure) {
        note(failure.what());
        const std::lock_guard lock(mutex_);
        writing_ = false;
        return;
    }
    {
        const std::lock_guard lock(mutex_);
        unchecked_[number] += bytes;
        if (unchecked_[number] <= part_ / kUnchecked)
            return;
        unchecked_[number] = 0;
    }
    removeOldest(number);
}

// Where a folder has more bytes than its part. Files may appear and disappear meanwhile.
void CacheFolder::removeOldest(size_t number)
{
    struct File {
        fs::file_time_type used;
        fs::path path;
        uint64_t bytes;
    };
    std::vector<File> files;
    const auto now = fs::file_time_type::clock::now();
    uint64_t all = 0;
    std::error_code error;
    for (fs::directory_iterator entry(folderOf(number), error); !error && entry != fs::directory_iterator();
         entry.increment(error)) {
        std::error_code gone;
        const fs::file_time_type used = entry->last_write_time(gone);
        const uintmax_t bytes = gone ? 0 : entry->file_size(gone);
        const bool temporary = entry->path().filename().native().front() == '.';
        if (gone || (temporary && used > now - kLongestWrite))
            continue;
        files.push_back({used, entry->path(), onDisk(bytes)});
        all += files.back().bytes;
    }
    if (all <= part_)
        return;
    std::sort(files.begin(), files.end(), [](const File &a, const File &b) { return a.used < b.used; });
    for (size_t i = 0; i < files.size() && all > part_ - part_ / kFreed; ++i) {
        fs::remove(files[i].path, error);
        std::error_code gone; // Windows says so as an error
        if (!error || !fs::exists(files[i].path, gone))
            all -= files[i].bytes;
        else if (!isInUse(error))
            note(utf8Text(files[i].path) + " cannot be removed: " + error.message());
    }
}

} // namespace vellum
