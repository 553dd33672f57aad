// SPDX-License-Identifier: Apache-2.0
#include "cli/base/files.h"

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "gltf/file/open_file.h"
#include "gltf/file/output_files.h"

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

bool isGltfName(const fs::path &path)
{
    const std::string suffix = suffixOf(path);
    return suffix == ".glb" || suffix == ".gltf";
}

std::vector<fs::path> gltfFilesIn(const fs::path &folder, const fs::path &except)
{
    std::vector<fs::path> found;
    std::error_code error;
    fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error);
    for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
        std::error_code unreadable;
        if (isGltfName(entry->path()) && entry->is_regular_file(unreadable) &&
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

std::vector<uint8_t> readStdin()
{
    constexpr size_t kMostBytes = size_t{1} << 31;
    constexpr size_t kBlock = size_t{1} << 20;
    std::vector<uint8_t> bytes;
    size_t count = 1;
    while (count != 0) {
        const size_t before = bytes.size();
        bytes.resize(before + kBlock);
        count = std::fread(bytes.data() + before, 1, kBlock, stdin);
        bytes.resize(before + count);
        if (bytes.size() > kMostBytes)
            throw GltfError("-: stdin has more than 2 GiB");
    }
    if (std::ferror(stdin) != 0)
        throw GltfError("-: stdin cannot be read");
    return bytes;
}

Document openDocument(const std::filesystem::path &path)
{
    return withinMemory(path, [&] { return isStandardStream(path) ? Document(path, readStdin()) : Document(path); });
}

void writeData(const std::filesystem::path &path, std::span<const uint8_t> bytes, std::optional<DataOutput> &data)
{
    if (!isStandardStream(path)) {
        writeWhole(path, bytes);
        return;
    }
    data->write(bytes);
    data->finish();
}

namespace
{

std::span<const uint8_t> bytesOf(std::string_view text)
{
    return {reinterpret_cast<const uint8_t *>(text.data()), text.size()};
}

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
    return start.find(kPngMark) != std::string::npos || start.starts_with(kSvgMark) ||
           start.find(kHtmlMark) != std::string::npos || isOwnJson(start);
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

void checkSuffix(const std::filesystem::path &output, std::initializer_list<std::string> suffixes)
{
    const std::string suffix = suffixOf(output);
    if (suffix.empty() || std::ranges::find(suffixes, suffix) != suffixes.end())
        return;
    std::string list;
    for (const std::string &fitting : suffixes)
        if (!fitting.empty() && list.find(fitting) == std::string::npos)
            list += (list.empty() ? "" : " or ") + fitting;
    throw UsageError(utf8Text(output) + " is the name of another kind of file: the output's must end in " + list);
}

void checkFolderOf(const std::filesystem::path &path)
{
    std::error_code error;
    if (std::filesystem::is_directory(path, error))
        throw Error(utf8Text(path) + " cannot be written: it is a directory");
    if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
        throw Error(utf8Text(path) + " cannot be written: it is there already and is not a file");
    const std::filesystem::path folder = path.parent_path().empty() ? "." : path.parent_path();
    if (!std::filesystem::is_directory(folder, error))
        throw Error(utf8Text(path) + " cannot be written: " + utf8Text(folder) + " is not a directory");
    if (const std::string problem = problemOfFolder(folder); !problem.empty())
        throw Error(utf8Text(path) + " cannot be written: " + problem);
    try {
        const NewFile probe(path); // where no permission says so, as in /proc
    } catch (const GltfError &failure) {
        throw Error(failure.what());
    }
}

void checkWritable(const std::filesystem::path &path, bool force)
{
    if (isStandardStream(path)) {
        if (!force && isTerminal(stdout))
            throw UsageError("stdout is a terminal: redirect it, or give an output file; --force writes to it");
        return;
    }
    checkFolderOf(path);
    std::error_code error;
    if (!force && std::filesystem::exists(path, error) && !isOwnOutput(path))
        throw Error(utf8Text(path) + " exists and was not written by vellum; --force replaces it");
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

void writeData(const std::filesystem::path &path, std::string_view text, std::optional<DataOutput> &data)
{
    writeData(path, bytesOf(text), data);
}

void writeWhole(const std::filesystem::path &path, std::string_view text)
{
    writeWhole(path, bytesOf(text));
}

} // namespace vellum::cli
