// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/module_file.h"

#include <cstring>
#include <fstream>
#include <iterator>

#include "cli/base/error.h"
#include "cli/base/standard_streams.h"
#include "spirv/module/module.h"

namespace vellum::cli
{
namespace
{

std::vector<uint8_t> readBytes(const std::filesystem::path &path)
{
    if (isStandardStream(path))
        return readStdin();
    std::ifstream file(path, std::ios::binary);
    std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    std::error_code error;
    if (!file || std::filesystem::is_directory(path, error))
        throw Error(path.string() + " cannot be read");
    return bytes;
}

} // namespace

std::vector<uint32_t> readModule(const std::filesystem::path &path)
{
    const std::vector<uint8_t> bytes = readBytes(path);
    std::vector<uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    if (bytes.size() % 4 != 0)
        throw Error(path.string() + ": not SPIR-V: its size is no multiple of 4 bytes");
    if (const std::string error = structureError(words); !error.empty())
        throw Error(path.string() + ": malformed SPIR-V: " + error);
    return words;
}

std::string structureError(std::span<const uint32_t> words)
{
    std::string error;
    return spirv::Module::parse(words, error) ? std::string() : error;
}

} // namespace vellum::cli
