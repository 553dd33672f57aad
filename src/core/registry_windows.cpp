// SPDX-License-Identifier: Apache-2.0
#include "core/registry_windows.h"

namespace vellum
{

std::vector<std::wstring> registeredFiles(HKEY hive, const wchar_t *key)
{
    HKEY opened = nullptr;
    if (RegOpenKeyExW(hive, key, 0, KEY_READ, &opened) != ERROR_SUCCESS)
        return {};
    std::vector<std::wstring> files;
    std::wstring name(16384, L'\0'); // the maximum length of a value's name, with its terminator
    LSTATUS status = ERROR_SUCCESS;
    for (DWORD i = 0; status == ERROR_SUCCESS || status == ERROR_MORE_DATA; ++i) {
        auto length = static_cast<DWORD>(name.size());
        DWORD type = REG_NONE;
        DWORD value = 0;
        DWORD bytes = sizeof value;
        status =
            RegEnumValueW(opened, i, name.data(), &length, nullptr, &type, reinterpret_cast<BYTE *>(&value), &bytes);
        if (status == ERROR_SUCCESS && type == REG_DWORD && value == 0)
            files.push_back(name.substr(0, length));
    }
    RegCloseKey(opened);
    return files;
}

} // namespace vellum
