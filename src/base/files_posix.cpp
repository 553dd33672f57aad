// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/error.h"
#include "core/utf8_path.h"

namespace vellum
{
std::optional<FileId> idOf(const std::filesystem::path &path)
{
    struct stat status {
    };
    if (stat(path.c_str(), &status) != 0)
        return std::nullopt;
    return FileId{status.st_dev, status.st_ino};
}

bool LocationOrder::operator()(const std::filesystem::path &a, const std::filesystem::path &b) const
{
    return a.native() < b.native();
}

uint64_t freeBytes(const std::filesystem::path &folder)
{
    struct statvfs facts {
    };
    if (statvfs(folder.c_str(), &facts) != 0)
        return UINT64_MAX;
    const bool full = facts.f_files != 0 && facts.f_favail == 0;
    return full ? 0 : uint64_t{facts.f_bavail} * facts.f_frsize;
}

std::string problemOfFolder(const std::filesystem::path &folder)
{
    return access(folder.c_str(), W_OK) == 0 ? "" : std::strerror(errno);
}

TemporaryFile::TemporaryFile()
{
    std::error_code error;
    std::filesystem::path folder = std::filesystem::temp_directory_path(error);
    if (!error) // it may be relative, and a program that gets the name may change its working directory
        folder = std::filesystem::absolute(folder, error);
    if (error)
        throw Error("the folder for temporary files (TMPDIR) cannot be used: " + error.message());
    std::string name = utf8Text(folder / "vellum-XXXXXX");
    const int descriptor = mkstemp(name.data());
    if (descriptor < 0)
        throw Error(name + " cannot be written");
    close(descriptor);
    path_ = name;
}

TemporaryFile::~TemporaryFile()
{
    std::error_code error;
    std::filesystem::remove(path_, error);
}

AppendedFile::AppendedFile(const std::filesystem::path &path)
    : path_(path), file_(open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOCTTY, 0666))
{
    if (file_ < 0)
        throw Error(utf8Text(path) + " cannot be written: " + std::strerror(errno));
}

AppendedFile::~AppendedFile()
{
    close(static_cast<int>(file_));
}

void AppendedFile::append(std::string_view text)
{
    ssize_t written = -1;
    do
        written = write(static_cast<int>(file_), text.data(), text.size());
    while (written < 0 && errno == EINTR);
    if (written != static_cast<ssize_t>(text.size()))
        throw Error(utf8Text(path_) + " cannot be written: " + std::strerror(written < 0 ? errno : ENOSPC));
}

bool isTerminal(std::FILE *stream)
{
    return isatty(fileno(stream)) == 1;
}

std::optional<size_t> terminalWidth()
{
    winsize size{};
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0)
        return std::nullopt;
    return size.ws_col;
}

std::FILE *duplicateStdout()
{
    const int copy = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    return copy < 0 ? nullptr : fdopen(copy, "wb");
}

bool sendStdoutToStderr()
{
    return dup2(STDERR_FILENO, STDOUT_FILENO) >= 0;
}

bool discardStdout()
{
    return std::freopen("/dev/null", "w", stdout) != nullptr;
}

} // namespace vellum
