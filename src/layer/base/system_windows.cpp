// SPDX-License-Identifier: Apache-2.0
#include "layer/base/system.h"

#include <system_error>

#include <windows.h>

#include "core/elevation_windows.h"
#include "core/registry_windows.h"
#include "core/utf8_path.h"

namespace vellum::layer
{
namespace
{

// Empty, which names no file, if the text is not UTF-8, such as a path in a settings file of another encoding.
std::wstring wide(std::string_view text)
{
    try {
        return utf8Path(text).native();
    } catch (const std::system_error &) {
        return {};
    }
}

// Empty if the text is not UTF-16.
std::string utf8(std::wstring_view text)
{
    try {
        return utf8Text(text);
    } catch (const std::system_error &) {
        return {};
    }
}

bool isFile(const std::wstring &path)
{
    const DWORD attributes = GetFileAttributesW(path.c_str());
    return attributes != INVALID_FILE_ATTRIBUTES && (attributes & FILE_ATTRIBUTE_DIRECTORY) == 0;
}

// The first that exists; empty if none does.
std::wstring registeredSettingsFile(HKEY hive)
{
    for (const std::wstring &file : registeredFiles(hive, L"Software\\Khronos\\Vulkan\\Settings"))
        if (isFile(file))
            return file;
    return {};
}

} // namespace

std::optional<std::string> environmentVariable(const std::string &name)
{
    if (isElevated())
        return std::nullopt;
    const std::wstring wideName = wide(name);
    std::wstring value(256, L'\0');
    for (;;) {
        SetLastError(ERROR_SUCCESS);
        const DWORD length = GetEnvironmentVariableW(wideName.c_str(), value.data(), static_cast<DWORD>(value.size()));
        if (length == 0 && GetLastError() != ERROR_SUCCESS)
            return std::nullopt;
        const bool whole = length < value.size();
        value.resize(length);
        if (whole)
            return utf8(value);
    }
}

std::vector<std::string> environmentNames()
{
    std::vector<std::string> names;
    wchar_t *const block = GetEnvironmentStringsW();
    for (const wchar_t *variable = block; variable && *variable;) {
        const std::wstring_view text = variable;
        names.push_back(utf8(text.substr(0, text.find(L'=', 1)))); // names of Windows' own begin with =
        variable += text.size() + 1;
    }
    FreeEnvironmentStringsW(block);
    return names;
}

std::string processName()
{
    std::wstring path(32768, L'\0');
    path.resize(GetModuleFileNameW(nullptr, path.data(), static_cast<DWORD>(path.size())));
    return utf8(path.substr(path.rfind(L'\\') + 1)) + " " + std::to_string(GetCurrentProcessId());
}

std::string userCacheFolder()
{
    const std::optional<std::string> folder = environmentVariable("LOCALAPPDATA");
    return folder && !folder->empty() ? *folder + "\\vellum" : std::string();
}

// The first file that exists of: one in the registry, of the user or the machine, where Vulkan Configurator enters it;
// the one that VK_LAYER_SETTINGS_PATH names; the one in the working directory.
std::string settingsFile(const std::function<void(const std::string &)> &report)
{
    const std::wstring name = L"vk_layer_settings.txt";
    if (!isElevated()) {
        if (const std::wstring file = registeredSettingsFile(HKEY_CURRENT_USER); !file.empty())
            return utf8(file);
    }
    if (const std::wstring file = registeredSettingsFile(HKEY_LOCAL_MACHINE); !file.empty())
        return utf8(file);
    if (const std::optional<std::string> path = environmentVariable("VK_LAYER_SETTINGS_PATH"); path && !path->empty()) {
        for (const std::wstring &file : {wide(*path), wide(*path) + L"\\" + name}) {
            if (isFile(file))
                return utf8(file);
        }
        report("VK_LAYER_SETTINGS_PATH is \"" + *path + "\" and must be a file of settings, or a folder with one");
    }
    return !isElevated() && isFile(name) ? utf8(name) : std::string();
}

bool appendToFile(const std::string &file, std::string_view bytes)
{
    const HANDLE handle =
        CreateFileW(wide(file).c_str(), FILE_APPEND_DATA, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE,
                    nullptr, OPEN_ALWAYS, FILE_ATTRIBUTE_NORMAL, nullptr);
    if (handle == INVALID_HANDLE_VALUE)
        return false;
    DWORD written = 0;
    const bool whole = GetFileType(handle) == FILE_TYPE_DISK &&
                       WriteFile(handle, bytes.data(), static_cast<DWORD>(bytes.size()), &written, nullptr) &&
                       written == bytes.size();
    CloseHandle(handle);
    return whole;
}

void stopInDebugger()
{
    DebugBreak();
}

void stayLoaded()
{
    static const char ofThisLibrary = 0;
    HMODULE library = nullptr;
    GetModuleHandleExW(GET_MODULE_HANDLE_EX_FLAG_PIN | GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS,
                       reinterpret_cast<LPCWSTR>(&ofThisLibrary), &library);
}

void *mapMemoryAt(void *address, size_t bytes)
{
    return VirtualAlloc(address, bytes, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
}

void unmapMemory(void *address, size_t)
{
    VirtualFree(address, 0, MEM_RELEASE);
}

} // namespace vellum::layer
