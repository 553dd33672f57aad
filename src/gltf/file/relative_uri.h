// SPDX-License-Identifier: Apache-2.0
// The names of files in glTF: URIs relative to the file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/file/json_tree.h"

namespace vellum
{

// A file's name as a URI: what is neither a letter, a digit, one of -._~/ nor part of a longer UTF-8 sequence is
// percent-encoded, bytes that are not UTF-8 among them.
std::string encodedUri(std::string_view name);

// Percent-encoding resolved. A percent sign that is not followed by two digits is itself: not every program encodes the
// names that it writes.
std::string percentDecoded(std::string_view text);

// The path that a URI means, percent-encoding resolved; nothing for data URIs and those with a scheme.
std::optional<std::filesystem::path> decodedUri(std::string_view uri);

// The files that a JSON value names by members "uri", in any object of it, extensions included.
std::vector<std::filesystem::path> namedFiles(const JsonValue &root);

} // namespace vellum
