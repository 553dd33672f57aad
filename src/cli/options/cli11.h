// SPDX-License-Identifier: Apache-2.0
// CLI11, whose options of type std::filesystem::path take UTF-8. Every file includes this in place of <CLI/CLI.hpp>.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/utf8_path.h"

namespace CLI::detail
{

// CLI11's templates look these up, and must therefore come after them. Their own conversion assigns the text, from
// which a path of Windows would take each byte as a character.
inline bool lexical_cast(const std::string &input, std::filesystem::path &output)
{
    output = vellum::utf8Path(input);
    return true;
}

inline bool lexical_cast(const std::string &input, std::optional<std::filesystem::path> &output)
{
    output = vellum::utf8Path(input);
    return true;
}

} // namespace CLI::detail

#include <CLI/CLI.hpp>
