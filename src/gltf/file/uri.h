// SPDX-License-Identifier: Apache-2.0
// URIs of files in glTF, which are relative to the file or hold the data themselves, and reading what they name.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/file/json_tree.h"

namespace vellum
{

class InputFile;

// A file's name as a URI: what is neither a letter, a digit, one of -._~/ nor part of a longer UTF-8 sequence is
// percent-encoded, bytes that are not UTF-8 among them.
std::string encodedUri(std::string_view name);

// Percent-encoding resolved. A percent sign that is not followed by two digits is itself: not every program encodes the
// names that it writes.
std::string percentDecoded(std::string_view text);

// The path that a URI means, percent-encoding resolved; nothing for data URIs and those with a scheme.
std::optional<std::filesystem::path> decodedUri(std::string_view uri);

// Returns whether a normal path of a URI leads out of the folder that it is relative to.
bool leadsOut(const std::filesystem::path &normal);

// The files that a JSON value names by members "uri", in any object of it, extensions included. What is in
// "extras" may mean anything.
std::vector<std::filesystem::path> namedFiles(const JsonValue &root);

// Throws GltfError, without the path, for anything but a regular file of at most 2 GiB: a directory, a pipe or a device
// is never opened.
std::vector<uint8_t> readWholeFile(const std::filesystem::path &path);

// Throws GltfError for a file of more than 2 GiB.
void checkSize(uint64_t bytes);

// The file that a URI means, relative to `folder`, whether it is there or not. Throws GltfUnsupported for a URI that is
// not a path below that folder: a file that was found somewhere should not be able to name any other on the machine.
std::filesystem::path fileOfUri(const std::filesystem::path &folder, std::string_view uri);

// Reads the file of a URI in a model. Throws GltfUnsupported where a link leads out of its folder
// (InputFile::requireBeside).
std::vector<uint8_t> readFileOfUri(const std::filesystem::path &model, std::string_view uri);

bool isDataUri(std::string_view uri);

struct DataUri {
    std::string mimeType;
    std::vector<uint8_t> bytes;
};

// Decodes a URI of which isDataUri is true (RFC 2397). Throws GltfError.
DataUri readDataUri(std::string_view uri);

} // namespace vellum
