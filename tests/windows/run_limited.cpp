// SPDX-License-Identifier: Apache-2.0
// Runs a program without the rights of an administrator, and ends as it does. Wine gives these to all programs, and in
// those the layer ignores the environment. usage: run_limited.exe program [arguments]
#include <cstdio>
#include <string>

#include <windows.h>

namespace
{

int fail(const char *what)
{
    std::fprintf(stderr, "run_limited: %s: error %lu\n", what, GetLastError());
    return 1;
}

// The command line after the first word.
std::wstring argumentsOf(const wchar_t *line)
{
    const wchar_t end = *line == L'"' ? L'"' : L' ';
    do
        ++line;
    while (*line != L'\0' && *line != end);
    while (*line == L'"' || *line == L' ')
        ++line;
    return line;
}

} // namespace

int main()
{
    HANDLE token = nullptr;
    TOKEN_LINKED_TOKEN linked{};
    DWORD size = 0;
    HANDLE limited = nullptr;
    if (!OpenProcessToken(GetCurrentProcess(), TOKEN_QUERY | TOKEN_DUPLICATE, &token) ||
        !GetTokenInformation(token, TokenLinkedToken, &linked, sizeof linked, &size) ||
        !DuplicateTokenEx(linked.LinkedToken, MAXIMUM_ALLOWED, nullptr, SecurityImpersonation, TokenPrimary, &limited))
        return fail("the user's token");
    std::wstring command = argumentsOf(GetCommandLineW());
    STARTUPINFOW startup{};
    startup.cb = sizeof startup;
    PROCESS_INFORMATION process{};
    if (!CreateProcessAsUserW(limited, nullptr, command.data(), nullptr, nullptr, TRUE, 0, nullptr, nullptr, &startup,
                              &process))
        return fail("the program cannot be started");
    WaitForSingleObject(process.hProcess, INFINITE);
    DWORD code = 1;
    GetExitCodeProcess(process.hProcess, &code);
    return static_cast<int>(code);
}
