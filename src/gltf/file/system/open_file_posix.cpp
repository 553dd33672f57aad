// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <sys/stat.h>
#include <unistd.h>

#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"

namespace vellum
{
namespace
{

[[noreturn]] void fail(int error)
{
    if (error == ENOENT || error == ENOTDIR)
        throw GltfError("no such file");
    throw GltfError(std::string("cannot be read: ") + std::strerror(error));
}

} // namespace

InputFile::InputFile(const std::filesystem::path &path) : path_(path)
{
    struct stat status {
    };
    if (stat(path.c_str(), &status) != 0)
        fail(errno);
    if (!S_ISREG(status.st_mode))
        throw GltfError("not a file");
    // O_NONBLOCK: it may have become a pipe meanwhile.
    const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (file < 0)
        fail(errno);
    if (fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
        close(file);
        throw GltfError("not a file");
    }
    file_ = file;
    size_ = static_cast<uint64_t>(status.st_size);
}

InputFile::~InputFile()
{
    close(static_cast<int>(file_));
}

size_t InputFile::read(std::span<uint8_t> bytes)
{
    size_t done = 0;
    while (done < bytes.size()) {
        const ssize_t count = ::read(static_cast<int>(file_), bytes.data() + done, bytes.size() - done);
        if (count < 0 && errno != EINTR)
            fail(errno);
        if (count == 0)
            break;
        done += count < 0 ? 0 : static_cast<size_t>(count);
    }
    return done;
}

std::filesystem::path InputFile::realPath() const
{
    std::error_code error;
    const auto real = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(file_), error);
    return error ? std::filesystem::canonical(path_, error) : real; // where /proc is not mounted
}

std::filesystem::path realFolder(const std::filesystem::path &folder)
{
    std::error_code error;
    std::filesystem::path real = std::filesystem::canonical(folder.empty() ? "." : folder, error);
    if (error)
        throw GltfError("the file's folder cannot be found: " + error.message());
    return real;
}

namespace
{

[[noreturn]] void failAt(const std::filesystem::path &path, const std::string &what, int error)
{
    const std::string message = path.string() + ": " + what + ": " + std::strerror(error);
    using Cause = GltfStorageError::Cause;
    if (error == ENOSPC || error == EDQUOT || error == EROFS)
        throw GltfStorageError(message, error == ENOSPC   ? Cause::Full
                                        : error == EDQUOT ? Cause::Quota
                                                          : Cause::ReadOnly);
    throw GltfError(message);
}

// `file` is a temporary name, or one of /proc for a file without a name.
bool linkTo(const std::filesystem::path &file, const std::filesystem::path &name)
{
    return linkat(AT_FDCWD, file.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
}

} // namespace

bool makeFolder(const std::filesystem::path &folder)
{
    std::error_code error;
    if (mkdir(folder.c_str(), 0777) == 0)
        return true;
    if (errno != EEXIST || !std::filesystem::is_directory(folder, error))
        failAt(folder, "the folder cannot be made", errno);
    return false;
}

void markUsed(const std::filesystem::path &file)
{
    static_cast<void>(utimensat(AT_FDCWD, file.c_str(), nullptr, 0));
}

void NewFile::fail() const
{
    failAt(path_, "cannot be written", errno);
}

NewFile::NewFile(const std::filesystem::path &path) : path_(path), folder_(folderOf(path))
{
    // A file without a name goes away with the process, however that ends.
    file_ = open(folder_.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (file_ >= 0 && access(readable().c_str(), F_OK) != 0)
        discard(); // /proc is not mounted, by which it would get its name
    if (file_ < 0) {
        temporary_ = temporaryName(path, [&](const std::filesystem::path &name) {
            file_ = open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
            return file_ >= 0 || errno != EEXIST;
        });
        if (file_ < 0)
            fail();
    }
}

NewFile::~NewFile()
{
    discard();
}

void NewFile::discard()
{
    if (file_ >= 0)
        close(static_cast<int>(file_));
    file_ = -1;
    if (!temporary_.empty())
        unlink(temporary_.c_str());
    temporary_.clear();
}

void NewFile::write(std::span<const uint8_t> bytes)
{
    while (!bytes.empty()) {
        const ssize_t written = ::write(static_cast<int>(file_), bytes.data(), bytes.size());
        if (written < 0 && errno != EINTR)
            fail();
        bytes = bytes.subspan(written < 0 ? 0 : static_cast<size_t>(written));
    }
}

void NewFile::finish()
{
    // EINVAL: something that cannot be synchronized.
    if (fsync(static_cast<int>(file_)) != 0 && errno != EINVAL)
        fail();
}

std::filesystem::path NewFile::readable() const
{
    return temporary_.empty() ? std::filesystem::path("/proc/self/fd/" + std::to_string(file_)) : temporary_;
}

NewFile::Appeared NewFile::appear()
{
    // Perhaps on a file server, which reports a lack of space only now, and shows others the name before the bytes.
    if (!temporary_.empty())
        finish();
    if (linkTo(readable(), path_))
        return Appeared::New;
    if (errno == EEXIST)
        return Appeared::No;
    if (temporary_.empty())
        fail();
    replace(); // a file system without links
    return Appeared::Replaced;
}

void NewFile::replace()
{
    // A file system without modes has none to keep.
    struct stat old {
    };
    if (stat(path_.c_str(), &old) == 0)
        static_cast<void>(fchmod(static_cast<int>(file_), old.st_mode & 0777));
    if (temporary_.empty()) {
        bool linked = false;
        std::filesystem::path name = temporaryName(path_, [&](const std::filesystem::path &free) {
            linked = linkTo(readable(), free);
            return linked || errno != EEXIST;
        });
        if (!linked)
            fail();
        temporary_ = std::move(name);
    }
    if (rename(temporary_.c_str(), path_.c_str()) != 0)
        fail();
    // Still there where the file had both names: a server reports a link that it has made as failed if the request was
    // repeated.
    unlink(temporary_.c_str());
    temporary_.clear();
}

void NewFile::syncName() const
{
    const int folder = open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0)
        return;
    fsync(folder);
    close(folder);
}

} // namespace vellum
