// SPDX-License-Identifier: Apache-2.0
// Files that are named on the command line: inputs, folders of them, and outputs, which are written whole or not at
// all. "-" is stdin or stdout.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "base/picture.h"
#include "core/utf8_path.h"
#include "gltf/document.h"
#include "gltf/file/gltf_error.h"

namespace vellum::cli
{

// The whole file, which may be a pipe but not a directory. Throws Error, with the path in front.
std::string readFile(const std::filesystem::path &path);

// Returns whether `path` is `folder` or below it, by their names.
bool isInside(const std::filesystem::path &path, const std::filesystem::path &folder);

// Returns whether a name ends in .glb or .gltf.
bool isGltfName(const std::filesystem::path &path);
// The .glb and .gltf files in a folder and in all folders in it, except those in `except`, by name. Throws Error.
std::vector<std::filesystem::path> gltfFilesIn(const std::filesystem::path &folder,
                                               const std::filesystem::path &except = {});

// Each file, and in place of each folder the glTF files in it. Throws Error for a folder without any.
std::vector<std::filesystem::path> gltfFiles(const std::vector<std::filesystem::path> &operands);

// All of stdin, at most 2 GiB. Throws GltfError.
std::vector<uint8_t> readStdin();

// Calls what reads a file. Throws GltfError, with the path in front, if there is too little memory.
template <typename Read>
auto withinMemory(const std::filesystem::path &path, Read &&read)
{
    try {
        return read();
    } catch (const std::bad_alloc &) {
        throw GltfError(utf8Text(path) + ": out of memory");
    }
}

// Reads a glTF file, from stdin for "-". Throws GltfError.
Document openDocument(const std::filesystem::path &path);

// Writes a file, whole or not at all; for "-" to `data`, which must then be there. Throws Error.
void writeData(const std::filesystem::path &path, std::span<const uint8_t> bytes, std::optional<DataOutput> &data);
void writeData(const std::filesystem::path &path, std::string_view text, std::optional<DataOutput> &data);

// This mark is in the first bytes of every HTML file that this command writes (of pictures: picture.h), and of the JSON
// that belongs to a page, whose schema may have any number. A file with it may be replaced.
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

// Makes a file in the folder of `path` that goes away again. Throws Error where none can be made.
void checkFolderOf(const std::filesystem::path &path);

// Checks before the work starts that a file, or "-" for stdout, can be written. Throws Error, also for a file that is
// there already and was not written by this command, and for a terminal, unless `force` is set.
void checkWritable(const std::filesystem::path &path, bool force);

// The file appears whole, whatever happens. Throws Error.
void writeWhole(const std::filesystem::path &path, std::span<const uint8_t> bytes);
void writeWhole(const std::filesystem::path &path, std::string_view text);

} // namespace vellum::cli
