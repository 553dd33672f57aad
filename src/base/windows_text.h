// SPDX-License-Identifier: Apache-2.0
// UTF-8 inside, UTF-16 for Windows.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <windows.h>

namespace vellum
{

std::wstring wide(std::string_view text);
std::string utf8(std::wstring_view text);
// The text that Windows has for an error; without `code`, for the last one of this thread.
std::string messageOf(DWORD code);
inline std::string lastMessage()
{
    return messageOf(GetLastError());
}
// A command line that CommandLineToArgvW and the C runtime split into these words.
std::wstring commandLineOf(std::span<const std::string> words);

} // namespace vellum
