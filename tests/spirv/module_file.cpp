// SPDX-License-Identifier: Apache-2.0
#include "module_file.h"

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace vellum::test
{

bool isModuleFile(const std::filesystem::path &file)
{
    return file.extension() == ".spv" || file.extension() == ".h";
}

std::vector<uint32_t> readModule(const std::filesystem::path &file)
{
    std::ifstream stream(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    std::vector<uint32_t> words;
    if (file.extension() == ".spv") {
        words.resize(bytes.size() / 4);
        std::memcpy(words.data(), bytes.data(), words.size() * 4);
    } else {
        for (size_t at = bytes.find("0x"); at != std::string::npos; at = bytes.find("0x", at + 2))
            words.push_back(static_cast<uint32_t>(std::strtoul(&bytes[at], nullptr, 16)));
    }
    if (words.empty())
        throw std::runtime_error("no words of SPIR-V in " + file.string());
    return words;
}

std::vector<std::filesystem::path> listedModules(const std::filesystem::path &list)
{
    std::ifstream stream(list);
    std::vector<std::filesystem::path> files;
    for (std::string line; std::getline(stream, line);)
        files.emplace_back(line);
    return files;
}

} // namespace vellum::test
