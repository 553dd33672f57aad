// SPDX-License-Identifier: Apache-2.0
// Files that a glTF file is in, or names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum
{

// Throws GltfError, without the path, for anything but a regular file of at most 2 GiB: a directory, a pipe or a device
// is never opened.
std::vector<uint8_t> readWholeFile(const std::filesystem::path &path);

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
