// SPDX-License-Identifier: Apache-2.0
#include "cli/base/output_file.h"

#include <algorithm>
#include <fstream>
#include <string>

#include "cli/base/error.h"
#include "cli/base/system/files.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/output_files.h"

namespace vellum::cli
{

namespace
{

bool isOwnJson(std::string_view start)
{
    if (!start.starts_with(kJsonMark[0]))
        return false;
    start.remove_prefix(kJsonMark[0].size());
    const size_t number = std::min(start.find_first_not_of("0123456789"), start.size());
    return number != 0 && start.substr(number).starts_with(kJsonMark[1]);
}

bool isOwnOutput(const std::filesystem::path &path)
{
    std::string start(1024, '\0');
    std::ifstream file(path, std::ios::binary);
    file.read(start.data(), static_cast<std::streamsize>(start.size()));
    start.resize(static_cast<size_t>(file.gcount()));
    return start.find(kPngMark) != std::string::npos || start.find(kHtmlMark) != std::string::npos || isOwnJson(start);
}

} // namespace

std::filesystem::path outputFor(const std::optional<std::filesystem::path> &said, const std::filesystem::path &standard)
{
    std::error_code error;
    if (!said)
        return standard;
    const bool folder = !said->has_filename() || std::filesystem::is_directory(*said, error);
    return folder ? *said / standard.filename() : *said;
}

void checkWritable(const std::filesystem::path &path, bool force)
{
    if (path == "-")
        return;
    const std::filesystem::path folder = path.parent_path().empty() ? "." : path.parent_path();
    std::error_code error;
    if (!std::filesystem::is_directory(folder, error))
        throw Error(path.string() + " cannot be written: " + folder.string() + " is not a directory");
    if (std::filesystem::is_directory(path, error))
        throw Error(path.string() + " cannot be written: it is a directory");
    if (const std::string problem = problemOfFolder(folder); !problem.empty())
        throw Error(path.string() + " cannot be written: " + problem);
    if (!force && std::filesystem::exists(path, error) && !isOwnOutput(path))
        throw Error(path.string() + " exists and was not written by vellum; --force replaces it");
}

void writeWhole(const std::filesystem::path &path, std::span<const uint8_t> bytes)
{
    try {
        OutputFiles files([] { return false; });
        FileContent content;
        content.add(bytes);
        files.write(path, content);
        files.publish();
    } catch (const GltfError &error) {
        throw Error(error.what());
    }
}

} // namespace vellum::cli
