// SPDX-License-Identifier: Apache-2.0
// Converts the bytes of a fuzz target to a glTF file.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

#include "check.h"

namespace vellum::test
{

using Bytes = std::vector<uint8_t>;
using Input = std::span<const uint8_t>;

// A file that is not on any disk.
class MemoryFile
{
public:
    explicit MemoryFile(Input bytes) : file_(memfd_create("gltf", 0))
    {
        FUZZ_CHECK(file_ >= 0 && write(file_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
    }
    ~MemoryFile() { close(file_); }
    MemoryFile(const MemoryFile &) = delete;
    MemoryFile &operator=(const MemoryFile &) = delete;
    [[nodiscard]] std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(file_); }

private:
    int file_;
};

inline void appendWord(Bytes &bytes, size_t word)
{
    for (unsigned i = 0; i < 4; ++i)
        bytes.push_back(static_cast<uint8_t>(word >> 8 * i));
}

inline Bytes glbOf(Input json)
{
    constexpr size_t kBinaryBytes = 1024;
    const size_t padded = (json.size() + 3) / 4 * 4;
    Bytes file;
    appendWord(file, 0x46546c67);
    appendWord(file, 2);
    appendWord(file, 28 + padded + kBinaryBytes);
    appendWord(file, padded);
    appendWord(file, 0x4e4f534a);
    file.insert(file.end(), json.begin(), json.end());
    file.resize(20 + padded, ' ');
    appendWord(file, kBinaryBytes);
    appendWord(file, 0x004e4942);
    // Small numbers, most of which are valid indices.
    for (size_t i = 0; i < kBinaryBytes; ++i)
        file.push_back(static_cast<uint8_t>(i % 4 == 0 ? i / 4 % 6 : 0));
    return file;
}

// A JSON of which a part is repeated: no mutation finds small files that need much memory. The first bytes state where
// the part begins, its length, and how often it is repeated; in each repetition, "#" is replaced by another number.
inline Bytes repeated(Input input)
{
    constexpr size_t kHeaderBytes = 6;
    constexpr size_t kMostBytes = size_t{1} << 18;
    if (input.size() < kHeaderBytes)
        return {};
    const auto number = [&](size_t at) { return input[at] + size_t{256} * input[at + 1]; };
    const std::string_view json(reinterpret_cast<const char *>(input.data()) + kHeaderBytes,
                                input.size() - kHeaderBytes);
    const size_t begin = std::min(number(0), json.size());
    const std::string_view part = json.substr(begin, number(2));
    std::string text(json.substr(0, begin));
    for (size_t i = 0; i < number(4) && text.size() + json.size() < kMostBytes; ++i)
        for (const char c : part)
            text += c == '#' ? std::to_string(i) : std::string(1, c);
    text += json.substr(begin + part.size());
    return {text.begin(), text.end()};
}

} // namespace vellum::test
