// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"
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

// WebAssembly has no files: none can be written.
bool makeFolder(const std::filesystem::path &folder)
{
    throw GltfError(utf8Text(folder) + ": the folder cannot be made");
}

void markUsed(const std::filesystem::path &) {}

void NewFile::fail() const
{
    throw GltfError(utf8Text(path_) + ": cannot be written");
}

NewFile::NewFile(const std::filesystem::path &path) : path_(path)
{
    fail();
}

NewFile::~NewFile() = default;

void NewFile::discard()
{
    file_ = -1;
}

void NewFile::write(std::span<const uint8_t>)
{
    fail();
}

void NewFile::finish()
{
    fail();
}

std::filesystem::path NewFile::readable() const
{
    return path_;
}

NewFile::Appeared NewFile::appear()
{
    fail();
}

void NewFile::replace()
{
    fail();
}

void NewFile::syncName() const {}

} // namespace vellum
