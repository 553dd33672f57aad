// SPDX-License-Identifier: Apache-2.0
// Paths as text. Inside the project text is UTF-8; a path of Windows has 16-bit characters.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace vellum
{

inline std::filesystem::path utf8Path(std::string_view text)
{
    return std::u8string(text.begin(), text.end());
}

inline std::string utf8Text(const std::filesystem::path &path)
{
    const std::u8string text = path.u8string();
    return {text.begin(), text.end()};
}

// ".glb" of "tree.GLB": the format that a file's name states.
inline std::string suffixOf(const std::filesystem::path &path)
{
    std::string suffix = utf8Text(path.extension());
    for (char &c : suffix)
        c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return suffix;
}

} // namespace vellum
