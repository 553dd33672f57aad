// SPDX-License-Identifier: Apache-2.0
// Where outputs go, and files that are written whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace vellum::cli
{

// In the first bytes of every PNG and HTML file that this command writes, and of the JSON that belongs to a page, whose
// schema may have any number. A file with it may be replaced.
inline constexpr std::string_view kPngMark("tEXtSoftware\0vellum", 19);
inline constexpr std::string_view kHtmlMark = "<meta name=\"generator\" content=\"vellum\">";
inline constexpr std::string_view kJsonMark[] = {R"({"schema":"vellum/)", R"(","command":"bench",)"};

// The output for what the user said: a file, a folder (one that exists, or a name that ends in a slash) for a file with
// the standard name, or nothing for `standard` itself.
std::filesystem::path outputFor(const std::optional<std::filesystem::path> &said,
                                const std::filesystem::path &standard);

// Throws UsageError for an output whose name ends in the suffix of another format than these. A name without a suffix,
// and
// "-", fit every format.
void checkSuffix(const std::filesystem::path &output, std::initializer_list<std::string> suffixes);

// Checks before the work starts that a file, or "-" for stdout, can be written. Throws Error, also for a file that is
// there already and was not written by this command, and for a terminal, unless `force` is set.
void checkWritable(const std::filesystem::path &path, bool force);

// The file appears whole, whatever happens. Throws Error.
void writeWhole(const std::filesystem::path &path, std::span<const uint8_t> bytes);

} // namespace vellum::cli
