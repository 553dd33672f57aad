// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <fcntl.h>
#include <io.h>

#include "base/error.h"
#include "base/windows_text.h"
#include "core/utf8_path.h"

namespace vellum
{
std::optional<FileId> idOf(const std::filesystem::path &path)
{
    const HANDLE file = CreateFileW(path.c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                                    OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr);
    if (file == INVALID_HANDLE_VALUE)
        return std::nullopt;
    BY_HANDLE_FILE_INFORMATION facts;
    const bool known = GetFileInformationByHandle(file, &facts) != 0;
    CloseHandle(file);
    if (!known)
        return std::nullopt;
    return FileId{facts.dwVolumeSerialNumber, uint64_t{facts.nFileIndexHigh} << 32 | facts.nFileIndexLow};
}

bool LocationOrder::operator()(const std::filesystem::path &a, const std::filesystem::path &b) const
{
    return CompareStringOrdinal(a.c_str(), -1, b.c_str(), -1, TRUE) == CSTR_LESS_THAN;
}

uint64_t freeBytes(const std::filesystem::path &folder)
{
    std::error_code error;
    const std::filesystem::space_info space = std::filesystem::space(folder, error);
    return error ? UINT64_MAX : space.available;
}

// A folder's attributes say nothing about new files in it, and its access control list little.
std::string problemOfFolder(const std::filesystem::path &)
{
    return "";
}

TemporaryFile::TemporaryFile()
{
    wchar_t name[MAX_PATH];
    std::error_code error;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
    if (error)
        throw Error("the folder for temporary files (TMP) cannot be used: " + error.message());
    if (GetTempFileNameW(folder.c_str(), L"vel", 0, name) == 0)
        throw Error("no file can be made in " + utf8Text(folder) + ": " + lastMessage());
    path_ = name;
}

TemporaryFile::~TemporaryFile()
{
    std::error_code error;
    std::filesystem::remove(path_, error);
}

AppendedFile::AppendedFile(const std::filesystem::path &path) : path_(path)
{
    const HANDLE file = CreateFileW(path.c_str(), FILE_APPEND_DATA | SYNCHRONIZE,
                                    FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr, OPEN_ALWAYS,
                                    FILE_ATTRIBUTE_NORMAL, nullptr);
    if (file == INVALID_HANDLE_VALUE)
        throw Error(utf8Text(path) + " cannot be written: " + lastMessage());
    file_ = reinterpret_cast<intptr_t>(file);
}

AppendedFile::~AppendedFile()
{
    CloseHandle(reinterpret_cast<HANDLE>(file_));
}

void AppendedFile::append(std::string_view text)
{
    DWORD written = 0;
    if (!WriteFile(reinterpret_cast<HANDLE>(file_), text.data(), static_cast<DWORD>(text.size()), &written, nullptr))
        throw Error(utf8Text(path_) + " cannot be written: " + lastMessage());
    if (written != text.size())
        throw Error(utf8Text(path_) + " cannot be written: the disk is full");
}

bool isTerminal(std::FILE *stream)
{
    DWORD mode = 0;
    return GetConsoleMode(reinterpret_cast<HANDLE>(_get_osfhandle(_fileno(stream))), &mode) != 0;
}

std::optional<size_t> terminalWidth()
{
    CONSOLE_SCREEN_BUFFER_INFO info;
    if (GetConsoleScreenBufferInfo(GetStdHandle(STD_OUTPUT_HANDLE), &info) == 0)
        return std::nullopt;
    return static_cast<size_t>(info.srWindow.Right - info.srWindow.Left + 1);
}

std::FILE *duplicateStdout()
{
    HANDLE copy = nullptr;
    const auto output = reinterpret_cast<HANDLE>(_get_osfhandle(_fileno(stdout)));
    if (DuplicateHandle(GetCurrentProcess(), output, GetCurrentProcess(), &copy, 0, FALSE, DUPLICATE_SAME_ACCESS) == 0)
        return nullptr;
    const int descriptor = _open_osfhandle(reinterpret_cast<intptr_t>(copy), _O_BINARY);
    return descriptor < 0 ? nullptr : _fdopen(descriptor, "wb");
}

bool sendStdoutToStderr()
{
    return _dup2(_fileno(stderr), _fileno(stdout)) == 0;
}

bool discardStdout()
{
    return std::freopen("NUL", "wb", stdout) != nullptr;
}

} // namespace vellum
