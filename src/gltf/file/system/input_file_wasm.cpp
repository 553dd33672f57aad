// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "gltf/file/gltf_error.h"
#include "gltf/file/input_file.h"
#include "gltf/file/system/memory_files.h"

namespace vellum
{
namespace
{

// What is left of a file that is open.
using Rest = std::span<const uint8_t>;

std::filesystem::path rooted(const std::filesystem::path &path)
{
    return (std::filesystem::path("/") / path).lexically_normal();
}

} // namespace

InputFile::InputFile(const std::filesystem::path &path) : path_(path)
{
    const std::span<const uint8_t> *found = MemoryFiles::find(path);
    if (found == nullptr)
        throw GltfError("no such file");
    size_ = found->size();
    file_ = reinterpret_cast<intptr_t>(new Rest(*found));
}

InputFile::~InputFile()
{
    delete reinterpret_cast<Rest *>(file_);
}

size_t InputFile::read(std::span<uint8_t> bytes)
{
    Rest &rest = *reinterpret_cast<Rest *>(file_);
    const size_t count = std::min(bytes.size(), rest.size());
    std::copy_n(rest.begin(), count, bytes.begin());
    rest = rest.subspan(count);
    return count;
}

std::filesystem::path InputFile::realPath() const
{
    return rooted(path_);
}

std::filesystem::path realFolder(const std::filesystem::path &folder)
{
    std::filesystem::path real = rooted(folder);
    return real.has_filename() ? real : real.parent_path();
}

} // namespace vellum
