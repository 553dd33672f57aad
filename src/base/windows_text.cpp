// SPDX-License-Identifier: Apache-2.0
#include "base/windows_text.h"

namespace vellum
{

std::wstring wide(std::string_view text)
{
    const int size = static_cast<int>(text.size());
    std::wstring result(static_cast<size_t>(MultiByteToWideChar(CP_UTF8, 0, text.data(), size, nullptr, 0)), L'\0');
    MultiByteToWideChar(CP_UTF8, 0, text.data(), size, result.data(), static_cast<int>(result.size()));
    return result;
}

std::string utf8(std::wstring_view text)
{
    const int size = static_cast<int>(text.size());
    const int bytes = WideCharToMultiByte(CP_UTF8, 0, text.data(), size, nullptr, 0, nullptr, nullptr);
    std::string result(static_cast<size_t>(bytes), '\0');
    WideCharToMultiByte(CP_UTF8, 0, text.data(), size, result.data(), bytes, nullptr, nullptr);
    return result;
}

std::string messageOf(DWORD code)
{
    wchar_t text[512];
    const DWORD flags = FORMAT_MESSAGE_FROM_SYSTEM | FORMAT_MESSAGE_IGNORE_INSERTS | FORMAT_MESSAGE_MAX_WIDTH_MASK;
    const DWORD size = FormatMessageW(flags, nullptr, code, 0, text, static_cast<DWORD>(std::size(text)), nullptr);
    std::string message = utf8({text, size});
    message.erase(message.find_last_not_of(" .") + 1);
    return message.empty() ? "error " + std::to_string(code) : message;
}

std::wstring commandLineOf(std::span<const std::string> words)
{
    std::wstring line;
    for (const std::string &word : words) {
        if (!line.empty())
            line += L' ';
        if (!word.empty() && word.find_first_of(" \t\n\v\"") == std::string::npos) {
            line += wide(word);
            continue;
        }
        // Backslashes are doubled before a quotation mark only.
        line += L'"';
        size_t backslashes = 0;
        for (const wchar_t c : wide(word)) {
            if (c == L'"')
                line.append(backslashes + 1, L'\\');
            backslashes = c == L'\\' ? backslashes + 1 : 0;
            line += c;
        }
        line.append(backslashes, L'\\');
        line += L'"';
    }
    return line;
}

} // namespace vellum
