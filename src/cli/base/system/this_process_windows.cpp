// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <io.h>
#include <vulkan/vulkan_core.h>

#include "cli/base/exit_code.h"
#include "cli/base/system/this_process.h"
#include "cli/base/system/windows_text.h"
#include "core/elevation_windows.h"

#include <delayimp.h> // after windows.h
#include <shellapi.h>

namespace vellum::cli
{
namespace
{

UINT codePageBefore = 0;

// Texts are UTF-8, and progress uses escape sequences.
void prepareConsole()
{
    for (const DWORD stream : {STD_OUTPUT_HANDLE, STD_ERROR_HANDLE}) {
        const HANDLE console = GetStdHandle(stream);
        if (DWORD mode = 0; GetConsoleMode(console, &mode) != 0)
            SetConsoleMode(console, mode | ENABLE_PROCESSED_OUTPUT | ENABLE_VIRTUAL_TERMINAL_PROCESSING);
    }
    codePageBefore = GetConsoleOutputCP();
    if (codePageBefore != 0 && SetConsoleOutputCP(CP_UTF8) != 0) // the console may be a shell's, which goes on
        std::atexit([] { SetConsoleOutputCP(codePageBefore); });
}

// The loader of Vulkan, when the first of its functions is called: from beside this program or from Windows, but not
// from the working directory, in which the files of others may be. Without one, functions are looked for in this
// program, where they are not.
FARPROC WINAPI findVulkan(unsigned what, DelayLoadInfo *)
{
    if (what != dliNotePreLoadLibrary)
        return nullptr;
    HMODULE loader =
        LoadLibraryExW(L"vulkan-1.dll", nullptr, LOAD_LIBRARY_SEARCH_APPLICATION_DIR | LOAD_LIBRARY_SEARCH_SYSTEM32);
    if (loader == nullptr)
        loader = GetModuleHandleW(nullptr);
    return reinterpret_cast<FARPROC>(reinterpret_cast<void *>(loader));
}

// Every function, where there is no loader.
VkResult VKAPI_CALL withoutLoader()
{
    return VK_ERROR_INCOMPATIBLE_DRIVER;
}

// An exception cannot pass through Vulkan's functions.
FARPROC WINAPI replaceFunction(unsigned what, DelayLoadInfo *info)
{
    if (what != dliFailGetProc)
        return nullptr;
    if (info->hmodCur == GetModuleHandleW(nullptr))
        return reinterpret_cast<FARPROC>(reinterpret_cast<void *>(withoutLoader));
    std::fprintf(stderr, "vellum: %s is too old: it has no %s\n", info->szDll, info->dlp.szProcName);
    std::exit(static_cast<int>(ExitCode::Failed));
}

} // namespace

std::vector<std::string> prepareProcess(int, char **)
{
    for (std::FILE *stream : {stdin, stdout, stderr})
        _setmode(_fileno(stream), _O_BINARY); // what is written is the same on every system
    std::setvbuf(stderr, nullptr, _IONBF, 0); // what a process printed before a crash is wanted
    prepareConsole();
    __pfnDliNotifyHook2 = findVulkan;
    __pfnDliFailureHook2 = replaceFunction;
    // A dialog would be waited for.
    SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX | SEM_NOOPENFILEERRORBOX);
    int count = 0;
    std::vector<std::string> words;
    wchar_t **const arguments = CommandLineToArgvW(GetCommandLineW(), &count);
    for (int i = 1; i < count; ++i)
        words.push_back(utf8(arguments[i]));
    LocalFree(arguments);
    return words;
}

std::filesystem::path programPath()
{
    std::wstring path(32768, L'\0');
    path.resize(GetModuleFileNameW(nullptr, path.data(), static_cast<DWORD>(path.size())));
    return path;
}

bool environmentIsIgnored()
{
    return isElevated();
}

std::optional<std::string> variable(const char *name)
{
    const wchar_t *value = _wgetenv(wide(name).c_str());
    return value != nullptr ? std::optional<std::string>(utf8(value)) : std::nullopt;
}

void setVariable(const char *name, const std::string &value)
{
    _wputenv_s(wide(name).c_str(), wide(value).c_str());
}

} // namespace vellum::cli
