// SPDX-License-Identifier: Apache-2.0
// Files that are registered in Windows' registry.
#pragma once

#include <string>
#include <vector>
#include <windows.h>

namespace vellum
{

// Names of the numbers of a key that are 0. By the Vulkan loader's convention such a name is the path of a file, and
// any other number disables the file.
std::vector<std::wstring> registeredFiles(HKEY hive, const wchar_t *key);

} // namespace vellum
