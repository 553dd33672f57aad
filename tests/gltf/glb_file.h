// SPDX-License-Identifier: Apache-2.0
// A small GLB made up for tests: one alpha-masked card and one solid triangle.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace vellum::test
{

using Bytes = std::vector<uint8_t>;

// Appends the values as they stand in memory.
template <typename T>
void append(Bytes &bytes, const std::vector<T> &values)
{
    const size_t old = bytes.size();
    bytes.resize(old + values.size() * sizeof(T));
    std::memcpy(bytes.data() + old, values.data(), values.size() * sizeof(T));
}

// Text to replace in the file's JSON, each exactly once (anything else is an error of the test).
using Replacements = std::vector<std::pair<std::string, std::string>>;

// A 16 x 16 PNG: white, opaque in a disc.
Bytes discPng();

// The JSON of the card with an image of `imageBytes` bytes in its binary chunk.
std::string cardJson(size_t imageBytes, size_t binaryBytes);

// The primitive of the card in that JSON.
inline const std::string kCardPrimitive =
    R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0})";

// Packs a GLB. The chunks are padded.
Bytes packGlb(std::string json, Bytes binary);

Bytes cardGlb(const Replacements &replacements = {});

// Writes the card as a .gltf, with data.bin and disc.png in the same folder, and returns its text.
std::string writeCardGltf(const std::filesystem::path &path, const Bytes &png = discPng(),
                          const Replacements &replacements = {});

void writeFile(const std::filesystem::path &path, const Bytes &bytes);
Bytes readFile(const std::filesystem::path &path);
std::string readText(const std::filesystem::path &path);

// A fresh folder below the system's temporary one, deleted with all that is in it.
class TemporaryFolder
{
public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder &) = delete;
    TemporaryFolder &operator=(const TemporaryFolder &) = delete;
    [[nodiscard]] std::filesystem::path operator/(const std::string &name) const { return path_ / name; }
    [[nodiscard]] const std::filesystem::path &path() const { return path_; }

private:
    std::filesystem::path path_;
};

} // namespace vellum::test
