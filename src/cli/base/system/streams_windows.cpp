// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <io.h>

#include "cli/base/system/streams.h"
#include "cli/base/system/windows_text.h"

namespace vellum::cli
{

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

} // namespace vellum::cli
