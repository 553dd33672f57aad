// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <system_error>
#include <windows.h>

#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"

namespace vellum
{
namespace
{

HANDLE handleOf(intptr_t file)
{
    return reinterpret_cast<HANDLE>(file);
}

// With the prefix \\?\, and in the case that the file system has. If the volume's driver does not support that, `named`
// without links; empty if that fails as well.
std::filesystem::path finalPath(HANDLE handle, const std::filesystem::path &named)
{
    std::wstring path(GetFinalPathNameByHandleW(handle, nullptr, 0, VOLUME_NAME_DOS), L'\0');
    if (!path.empty())
        path.resize(GetFinalPathNameByHandleW(handle, path.data(), static_cast<DWORD>(path.size()), VOLUME_NAME_DOS));
    if (!path.empty())
        return path;
    std::error_code error;
    return std::filesystem::canonical(named, error);
}

} // namespace

InputFile::InputFile(const std::filesystem::path &path) : path_(path)
{
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status))
        throw GltfError("no such file");
    if (!std::filesystem::is_regular_file(status))
        throw GltfError("not a file");
    const HANDLE handle =
        CreateFileW(path.c_str(), GENERIC_READ, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                    OPEN_EXISTING, FILE_ATTRIBUTE_NORMAL, nullptr);
    if (handle == INVALID_HANDLE_VALUE)
        throw GltfError("cannot be read");
    LARGE_INTEGER size{};
    if (GetFileType(handle) != FILE_TYPE_DISK || !GetFileSizeEx(handle, &size)) {
        CloseHandle(handle);
        throw GltfError("not a file");
    }
    file_ = reinterpret_cast<intptr_t>(handle);
    size_ = static_cast<uint64_t>(size.QuadPart);
}

InputFile::~InputFile()
{
    CloseHandle(handleOf(file_));
}

size_t InputFile::read(std::span<uint8_t> bytes)
{
    constexpr size_t kAtOnce = size_t{1} << 30;
    size_t done = 0;
    while (done < bytes.size()) {
        DWORD count = 0;
        if (!ReadFile(handleOf(file_), bytes.data() + done,
                      static_cast<DWORD>(std::min(bytes.size() - done, kAtOnce)), &count, nullptr))
            throw GltfError("cannot be read");
        if (count == 0)
            break;
        done += count;
    }
    return done;
}

std::filesystem::path InputFile::realPath() const
{
    return finalPath(handleOf(file_), path_);
}

std::filesystem::path realFolder(const std::filesystem::path &folder)
{
    const std::filesystem::path named = folder.empty() ? "." : folder;
    const HANDLE handle = CreateFileW(named.c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                                      OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr); // for a folder
    if (handle == INVALID_HANDLE_VALUE)
        throw GltfError("the file's folder cannot be found");
    std::filesystem::path real = finalPath(handle, named);
    CloseHandle(handle);
    if (real.empty())
        throw GltfError("the file's folder cannot be found");
    return real;
}

namespace
{

[[noreturn]] void failAt(const std::filesystem::path &path, const std::string &what)
{
    const DWORD error = GetLastError();
    const std::string message =
        utf8Text(path) + ": " + what + ": " + std::system_category().message(static_cast<int>(error));
    if (error == ERROR_DISK_FULL || error == ERROR_HANDLE_DISK_FULL || error == ERROR_WRITE_PROTECT)
        throw GltfStorageError(message, error == ERROR_WRITE_PROTECT ? GltfStorageError::Cause::ReadOnly
                                                                     : GltfStorageError::Cause::Full);
    throw GltfError(message);
}

// Sets whether the file goes away when it is closed, which the system also does for a process that ends.
bool setTemporary(intptr_t file, bool temporary)
{
    FILE_DISPOSITION_INFO info{};
    info.DeleteFile = temporary;
    return SetFileInformationByHandle(handleOf(file), FileDispositionInfo, &info, sizeof info) != 0;
}

// Returns whether `rename` returns true, at once or soon: virus scanners and the like open new files for a moment, and
// a file that is open cannot be renamed.
template <typename Rename>
bool isRenamed(Rename &&rename)
{
    constexpr int kTries = 20;
    constexpr DWORD kMillisecondsBetween = 25;
    for (int i = 1; !rename(); ++i) {
        const DWORD error = GetLastError();
        if (i == kTries || (error != ERROR_ACCESS_DENIED && error != ERROR_SHARING_VIOLATION))
            return false;
        Sleep(kMillisecondsBetween);
    }
    return true;
}

} // namespace

bool makeFolder(const std::filesystem::path &folder)
{
    if (CreateDirectoryW(folder.c_str(), nullptr))
        return true;
    const DWORD attributes = GetFileAttributesW(folder.c_str());
    if (attributes != INVALID_FILE_ATTRIBUTES && (attributes & FILE_ATTRIBUTE_DIRECTORY) != 0)
        return false;
    failAt(folder, "the folder cannot be made");
}

void markUsed(const std::filesystem::path &file)
{
    std::error_code error;
    std::filesystem::last_write_time(file, std::filesystem::file_time_type::clock::now(), error);
}

void NewFile::fail() const
{
    failAt(path_, "cannot be written");
}

NewFile::NewFile(const std::filesystem::path &path) : path_(path)
{
    HANDLE handle = INVALID_HANDLE_VALUE;
    std::filesystem::path name = temporaryName(path, [&](const std::filesystem::path &free) {
        handle = CreateFileW(free.c_str(), GENERIC_READ | GENERIC_WRITE | DELETE,
                             FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr, CREATE_NEW,
                             FILE_ATTRIBUTE_NORMAL, nullptr);
        return handle != INVALID_HANDLE_VALUE || GetLastError() != ERROR_FILE_EXISTS;
    });
    if (handle == INVALID_HANDLE_VALUE)
        fail();
    file_ = reinterpret_cast<intptr_t>(handle);
    setTemporary(file_, true);
    temporary_ = std::move(name);
}

NewFile::~NewFile()
{
    discard();
}

void NewFile::discard()
{
    if (file_ != -1)
        CloseHandle(handleOf(file_));
    file_ = -1;
    if (!temporary_.empty())
        DeleteFileW(temporary_.c_str());
    temporary_.clear();
}

void NewFile::write(std::span<const uint8_t> bytes)
{
    constexpr size_t kAtOnce = size_t{1} << 30;
    while (!bytes.empty()) {
        DWORD written = 0;
        const auto count = static_cast<DWORD>(std::min(bytes.size(), kAtOnce));
        if (!WriteFile(handleOf(file_), bytes.data(), count, &written, nullptr))
            fail();
        bytes = bytes.subspan(written);
    }
}

void NewFile::finish()
{
    if (!FlushFileBuffers(handleOf(file_)))
        fail();
}

NewFile::Appeared NewFile::appear()
{
    setTemporary(file_, false);
    CloseHandle(handleOf(file_));
    file_ = -1;
    if (isRenamed([&] { return MoveFileExW(temporary_.c_str(), path_.c_str(), MOVEFILE_WRITE_THROUGH) != 0; })) {
        temporary_.clear();
        return Appeared::New;
    }
    if (GetLastError() != ERROR_ALREADY_EXISTS && GetLastError() != ERROR_FILE_EXISTS)
        fail();
    return Appeared::No;
}

void NewFile::replace()
{
    // The first keeps the permissions and attributes of what is replaced. Not every file system has it, and where it
    // fails with ERROR_UNABLE_TO_MOVE_REPLACEMENT the old file is gone.
    const bool replaced = isRenamed([&] {
        return ReplaceFileW(path_.c_str(), temporary_.c_str(), nullptr, REPLACEFILE_IGNORE_MERGE_ERRORS, nullptr,
                            nullptr) != 0 ||
               MoveFileExW(temporary_.c_str(), path_.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH) != 0;
    });
    const DWORD error = GetLastError();
    const std::filesystem::path temporary = std::move(temporary_);
    if (replaced)
        return;
    const bool oldIsGone = GetFileAttributesW(path_.c_str()) == INVALID_FILE_ATTRIBUTES;
    if (!oldIsGone)
        DeleteFileW(temporary.c_str());
    SetLastError(error);
    failAt(path_,
           oldIsGone ? "cannot be written; what it was to contain is in " + utf8Text(temporary) : "cannot be written");
}

std::filesystem::path NewFile::readable() const
{
    return temporary_;
}

void NewFile::syncName() const {}

} // namespace vellum
