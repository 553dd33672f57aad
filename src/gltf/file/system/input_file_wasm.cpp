// SPDX-License-Identifier: Apache-2.0
// WebAssembly has no files: documents are in memory, and what they name is not found.
#include "gltf/file/gltf_error.h"
#include "gltf/file/input_file.h"

namespace vellum
{

InputFile::InputFile(const std::filesystem::path &path) : path_(path)
{
    throw GltfError("no such file");
}

InputFile::~InputFile() = default;

size_t InputFile::read(std::span<uint8_t>)
{
    return 0;
}

std::filesystem::path InputFile::realPath() const
{
    return path_;
}

std::filesystem::path realFolder(const std::filesystem::path &)
{
    throw GltfError("the file's folder cannot be found");
}

} // namespace vellum
