// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/output_files.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

#include "bake/bake.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

[[noreturn]] void fail(const std::filesystem::path &path, const std::string &what, int error)
{
    throw GltfError(path.string() + ": " + what + ": " + std::strerror(error));
}

std::filesystem::path folderOf(const std::filesystem::path &path)
{
    return path.has_parent_path() ? path.parent_path() : ".";
}

// Another hidden name beside `path` at each call.
std::filesystem::path temporaryName(const std::filesystem::path &path)
{
    static std::atomic<unsigned> number{0};
    std::string name = ".";
    name.append(path.filename().string(), 0, 200).append(".").append(std::to_string(getpid()));
    name.append("-").append(std::to_string(number++)).append(".tmp");
    return folderOf(path) / name;
}

} // namespace

bool sameBytes(const std::filesystem::path &a, const std::filesystem::path &b)
{
    std::error_code error;
    if (std::filesystem::equivalent(a, b, error))
        return true;
    if (std::filesystem::file_size(a, error) != std::filesystem::file_size(b, error) || error)
        return false;
    std::ifstream one(a, std::ios::binary);
    std::ifstream other(b, std::ios::binary);
    std::vector<char> first(size_t{1} << 16);
    std::vector<char> second(first.size());
    while (one && other) {
        one.read(first.data(), static_cast<std::streamsize>(first.size()));
        other.read(second.data(), static_cast<std::streamsize>(second.size()));
        if (one.gcount() != other.gcount() || !std::equal(first.begin(), first.begin() + one.gcount(), second.begin()))
            return false;
    }
    return one.eof() && other.eof();
}

uint64_t FileContent::size() const
{
    uint64_t size = 0;
    for (const auto &piece : pieces_)
        size += piece.size();
    return size;
}

OutputFiles::~OutputFiles()
{
    for (Pending &pending : pending_)
        discard(pending);
    std::error_code ignored; // a folder may have got other files since
    if (!published_)
        for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder)
            std::filesystem::remove(*folder, ignored);
}

void OutputFiles::discard(Pending &pending)
{
    if (pending.descriptor >= 0)
        close(pending.descriptor);
    pending.descriptor = -1;
    if (!pending.temporary.empty())
        unlink(pending.temporary.c_str());
    pending.temporary.clear();
}

void OutputFiles::makeFolders(const std::filesystem::path &folder)
{
    std::error_code error;
    if (std::filesystem::is_directory(folder, error))
        return;
    if (folder.has_parent_path() && folder.parent_path() != folder)
        makeFolders(folder.parent_path());
    if (mkdir(folder.c_str(), 0777) == 0)
        folders_.push_back(folder);
    else if (errno != EEXIST || !std::filesystem::is_directory(folder, error))
        fail(folder, "the folder cannot be made", errno);
}

OutputFiles::Pending &OutputFiles::open(const std::filesystem::path &path, Existing existing)
{
    std::error_code error;
    // Devices must not be replaced either.
    if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
        throw GltfError(path.string() + ": cannot be written: it is there already and is not a file");
    makeFolders(folderOf(path));
    Pending &pending = pending_.emplace_back(Pending{path, folderOf(path), existing, -1, {}});
    // A file without a name goes away with the process, however that ends.
    pending.descriptor = ::open(pending.folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (pending.descriptor < 0) {
        std::filesystem::path name = temporaryName(path);
        pending.descriptor = ::open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
        if (pending.descriptor < 0)
            fail(path, "cannot be written", errno);
        pending.temporary = std::move(name);
    }
    return pending;
}

void OutputFiles::put(const Pending &pending, std::span<const uint8_t> bytes) const
{
    constexpr size_t kAtOnce = size_t{4} << 20;
    while (!bytes.empty()) {
        if (cancelled_ && cancelled_())
            throw BakeCancelled();
        const ssize_t written = ::write(pending.descriptor, bytes.data(), std::min(bytes.size(), kAtOnce));
        if (written < 0 && errno != EINTR)
            fail(pending.path, "cannot be written", errno);
        bytes = bytes.subspan(written < 0 ? 0 : static_cast<size_t>(written));
    }
}

void OutputFiles::finish(const Pending &pending) const
{
    // Who may read it stays. Where a file system knows no modes there is nothing to keep.
    struct stat old {
    };
    if (pending.existing == Existing::Replace && stat(pending.path.c_str(), &old) == 0)
        static_cast<void>(fchmod(pending.descriptor, old.st_mode & 0777));
    // EINVAL: something that cannot be synchronized.
    if (fsync(pending.descriptor) != 0 && errno != EINVAL)
        fail(pending.path, "cannot be written", errno);
}

void OutputFiles::write(const std::filesystem::path &path, const FileContent &content)
{
    write(path, content, Existing::Replace);
}

void OutputFiles::writeOnce(const std::filesystem::path &path, const FileContent &content)
{
    write(path, content, Existing::Keep);
}

void OutputFiles::write(const std::filesystem::path &path, const FileContent &content, Existing existing)
{
    const Pending &pending = open(path, existing);
    for (const auto &piece : content.pieces())
        put(pending, piece);
    finish(pending);
}

void OutputFiles::copy(const std::filesystem::path &from, const std::filesystem::path &to)
{
    std::error_code error;
    if (std::filesystem::exists(to, error)) {
        if (!sameBytes(from, to))
            throw GltfError(to.string() + ": is there already and differs from " + from.string());
        return;
    }
    std::ifstream file(from, std::ios::binary);
    const Pending &pending = open(to, Existing::Keep);
    std::vector<uint8_t> bytes(size_t{1} << 20);
    while (file) {
        file.read(reinterpret_cast<char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
        put(pending, std::span(bytes).first(static_cast<size_t>(file.gcount())));
    }
    if (!file.eof())
        throw GltfError(from.string() + ": cannot be read");
    finish(pending);
}

bool OutputFiles::publish(Pending &pending)
{
    const std::string opened = "/proc/self/fd/" + std::to_string(pending.descriptor);
    const auto link = [&](const std::filesystem::path &name) {
        return pending.temporary.empty()
                   ? linkat(AT_FDCWD, opened.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0
                   : ::link(pending.temporary.c_str(), name.c_str()) == 0;
    };
    if (link(pending.path))
        return true;
    if (errno != EEXIST && pending.temporary.empty())
        fail(pending.path, "cannot be written", errno);
    if (errno == EEXIST && pending.existing == Existing::Keep) {
        // Somebody else was quicker, another file of this run perhaps.
        const std::filesystem::path mine =
            pending.temporary.empty() ? std::filesystem::path(opened) : pending.temporary;
        if (!sameBytes(mine, pending.path))
            throw GltfError(pending.path.string() + ": is there already and is different");
        return false;
    }
    if (pending.temporary.empty()) {
        std::filesystem::path name = temporaryName(pending.path);
        if (!link(name))
            fail(pending.path, "cannot be written", errno);
        pending.temporary = std::move(name);
    }
    if (rename(pending.temporary.c_str(), pending.path.c_str()) != 0)
        fail(pending.path, "cannot be written", errno);
    pending.temporary.clear();
    return false;
}

void OutputFiles::publish()
{
    // There may be no memory any more once a file has appeared.
    std::vector<const Pending *> published;
    published.reserve(pending_.size());
    try {
        for (Pending &pending : pending_)
            if (publish(pending))
                published.push_back(&pending);
    } catch (...) {
        for (const Pending *pending : published)
            unlink(pending->path.c_str());
        throw;
    }
    published_ = true;
    for (Pending &pending : pending_) {
        discard(pending);
        // So that the names are on the disk as well. Not every file system supports that.
        const int folder = ::open(pending.folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (folder >= 0) {
            fsync(folder);
            close(folder);
        }
    }
    pending_.clear();
}

} // namespace vellum
