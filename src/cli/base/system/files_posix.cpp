// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/base/error.h"
#include "cli/base/system/files.h"
#include "core/utf8_path.h"

namespace vellum::cli
{

std::optional<FileId> idOf(const std::filesystem::path &path)
{
    struct stat status {
    };
    if (stat(path.c_str(), &status) != 0)
        return std::nullopt;
    return FileId{status.st_dev, status.st_ino};
}

std::string problemOfFolder(const std::filesystem::path &folder)
{
    return access(folder.c_str(), W_OK) == 0 ? "" : std::strerror(errno);
}

TemporaryFile::TemporaryFile()
{
    std::error_code error;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
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

SharedText::SharedText(std::string_view text) : descriptor_(memfd_create("vellum", MFD_CLOEXEC))
{
    for (size_t at = 0; at < text.size();) {
        const ssize_t written = ::write(descriptor_, text.data() + at, text.size() - at);
        if (written < 0 && errno != EINTR) {
            close(descriptor_);
            throw Error("no temporary file can be written");
        }
        at += written > 0 ? static_cast<size_t>(written) : 0;
    }
    path_ = "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(descriptor_);
}

SharedText::~SharedText()
{
    close(descriptor_);
}

} // namespace vellum::cli
