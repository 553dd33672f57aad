// SPDX-License-Identifier: Apache-2.0
// WebAssembly has no files: none can be written.
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/new_file.h"

namespace vellum
{

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
