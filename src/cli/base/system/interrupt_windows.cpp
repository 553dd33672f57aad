// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <windows.h>

#include "cli/base/system/interrupt.h"

namespace vellum::cli
{
namespace
{

std::atomic<bool> came{false};

// Windows calls it in a thread of its own. What it does not handle ends the process. So does a console that closes, or
// a user who logs off, as soon as this returns; without that, after some seconds, in which the process can clean up.
BOOL WINAPI remember(DWORD event)
{
    if (came.exchange(true))
        return FALSE;
    if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT)
        Sleep(INFINITE);
    return TRUE;
}

} // namespace

Interruptible::Interruptible()
{
    came = false;
    SetConsoleCtrlHandler(remember, TRUE);
}

Interruptible::~Interruptible()
{
    SetConsoleCtrlHandler(remember, FALSE);
}

bool Interruptible::interrupted()
{
    return came;
}

void Interruptible::die()
{
    ExitProcess(STATUS_CONTROL_C_EXIT);
}

} // namespace vellum::cli
