// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gltf/file/gltf_error.h"
#include "gltf/file/input_file.h"

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

} // namespace vellum
