// SPDX-License-Identifier: Apache-2.0
// Detects whether this process has the rights of an administrator.
#pragma once

#include <windows.h>

namespace vellum
{

// More rights than the programs of its user usually have. Vulkan's loader then ignores environment variables, and what
// is registered for the user.
inline bool isElevated()
{
    static const bool elevated = [] {
        HANDLE token = nullptr;
        if (!OpenProcessToken(GetCurrentProcess(), TOKEN_QUERY, &token))
            return false;
        TOKEN_ELEVATION elevation{};
        DWORD size = 0;
        const bool known = GetTokenInformation(token, TokenElevation, &elevation, sizeof elevation, &size);
        CloseHandle(token);
        return known && elevation.TokenIsElevated != 0;
    }();
    return elevated;
}

} // namespace vellum
