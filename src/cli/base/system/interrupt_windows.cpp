// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <windows.h>

#include "cli/base/system/interrupt.h"

namespace vellum::cli
{
namespace
{

std::atomic<bool> came{false};

// Windows calls it in a thread of its own. What it does not handle ends the process.
BOOL WINAPI remember(DWORD)
{
    return came.exchange(true) ? FALSE : TRUE;
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
