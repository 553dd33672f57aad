// SPDX-License-Identifier: Apache-2.0
#include "cli/base/input_files.h"

#include <algorithm>
#include <fstream>

#include "cli/base/error.h"
#include "core/utf8_path.h"

namespace vellum::cli
{

namespace fs = std::filesystem;

std::string readFile(const fs::path &path)
{
    std::error_code error;
    if (fs::is_directory(path, error))
        throw Error(utf8Text(path) + " cannot be read: it is a directory");
    std::ifstream file(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(file), {}};
    if (!file)
        throw Error(utf8Text(path) + " cannot be read");
    return bytes;
}

bool isInside(const fs::path &path, const fs::path &folder)
{
    const fs::path relative = path.lexically_relative(folder);
    return !relative.empty() && *relative.begin() != "..";
}

std::vector<fs::path> gltfFilesIn(const fs::path &folder, const fs::path &except)
{
    std::vector<fs::path> found;
    std::error_code error;
    fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error);
    for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
        const std::string suffix = suffixOf(entry->path());
        std::error_code unreadable;
        if ((suffix == ".glb" || suffix == ".gltf") && entry->is_regular_file(unreadable) &&
            !isInside(fs::weakly_canonical(entry->path(), unreadable), except))
            found.push_back(entry->path());
    }
    if (error)
        throw Error(utf8Text(folder) + " cannot be searched: " + error.message());
    std::sort(found.begin(), found.end());
    return found;
}

std::vector<fs::path> gltfFiles(const std::vector<fs::path> &operands)
{
    std::vector<fs::path> files;
    for (const fs::path &operand : operands) {
        std::error_code error;
        if (!fs::is_directory(operand, error)) {
            files.push_back(operand);
            continue;
        }
        const std::vector<fs::path> found = gltfFilesIn(operand);
        if (found.empty())
            throw Error(utf8Text(operand) + " has no .glb or .gltf files");
        files.insert(files.end(), found.begin(), found.end());
    }
    return files;
}

} // namespace vellum::cli
