// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>

#include <windows.h>

#include "gltf/file/gltf_error.h"
#include "gltf/file/input_file.h"

namespace vellum
{
namespace
{

HANDLE readHandleOf(intptr_t file)
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
    CloseHandle(readHandleOf(file_));
}

size_t InputFile::read(std::span<uint8_t> bytes)
{
    constexpr size_t kAtOnce = size_t{1} << 30;
    size_t done = 0;
    while (done < bytes.size()) {
        DWORD count = 0;
        if (!ReadFile(readHandleOf(file_), bytes.data() + done,
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
    return finalPath(readHandleOf(file_), path_);
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

} // namespace vellum
