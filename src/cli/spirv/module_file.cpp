// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/module_file.h"

#include <cstring>

#include "base/error.h"
#include "cli/base/files.h"
#include "core/utf8_path.h"
#include "spirv/module/module.h"

namespace vellum::cli
{

std::vector<uint32_t> readModule(const std::filesystem::path &path)
{
    std::vector<uint8_t> bytes;
    if (isStandardStream(path)) {
        bytes = readStdin();
    } else {
        const std::string file = readFile(path);
        bytes.assign(file.begin(), file.end());
    }
    std::vector<uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    if (bytes.size() % 4 != 0)
        throw Error(utf8Text(path) + ": not SPIR-V: its size is no multiple of 4 bytes");
    if (const std::string error = structureError(words); !error.empty())
        throw Error(utf8Text(path) + ": malformed SPIR-V: " + error);
    return words;
}

std::string structureError(std::span<const uint32_t> words)
{
    std::string error;
    return spirv::Module::parse(words, error) ? std::string() : error;
}

} // namespace vellum::cli
