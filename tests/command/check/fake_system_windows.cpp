// SPDX-License-Identifier: Apache-2.0
#include "fake_system.h"

#include <io.h>
#include <windows.h>

namespace vellum::test
{

void crash()
{
    RaiseException(static_cast<DWORD>(EXCEPTION_ACCESS_VIOLATION), EXCEPTION_NONCONTINUABLE, 0, nullptr);
}

void letParentStartNothing() {}

void leaveProcessBehind()
{
    wchar_t program[MAX_PATH];
    GetModuleFileNameW(nullptr, program, MAX_PATH);
    wchar_t line[] = L"vellum check --worker";
    STARTUPINFOW start{};
    start.cb = sizeof start;
    PROCESS_INFORMATION started{};
    CreateProcessW(program, line, nullptr, nullptr, TRUE, 0, nullptr, nullptr, &start, &started);
}

bool writeWhereEventsGo(std::string_view text)
{
    return _write(3, text.data(), static_cast<unsigned>(text.size())) == static_cast<int>(text.size());
}

} // namespace vellum::test
