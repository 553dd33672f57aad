// SPDX-License-Identifier: Apache-2.0
#include "glb_file.h"

#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>

#include "compressed.h"

namespace vellum::test
{
namespace
{

constexpr size_t kImageOffset = 92;

void appendWord(Bytes &bytes, size_t word)
{
    append(bytes, std::vector<uint32_t>{static_cast<uint32_t>(word)});
}

void replaceOnce(std::string &text, const std::string &from, const std::string &to)
{
    const size_t place = text.find(from);
    if (place == std::string::npos || text.find(from, place + 1) != std::string::npos)
        throw std::logic_error("\"" + from + "\" is not exactly once in the test's JSON");
    text.replace(place, from.size(), to);
}

} // namespace

Bytes discPng()
{
    constexpr uint32_t kSize = 16;
    Bytes rgba;
    for (uint32_t i = 0; i < kSize * kSize; ++i) {
        const int x = static_cast<int>(i % kSize) - 8;
        const int y = static_cast<int>(i / kSize) - 8;
        const uint8_t alpha = x * x + y * y < 36 ? 255 : 0;
        rgba.insert(rgba.end(), {255, 255, 255, alpha});
    }
    return pngImage(kSize, kSize, 8, kRgba, false, rgba);
}

std::string cardJson(size_t imageBytes, size_t binaryBytes)
{
    std::string json = R"({
"asset": {"version": "2.0"},
"scene": 0, "scenes": [{"nodes": [0]}],
"nodes": [{"mesh": 0, "translation": [0, 2, 0]}],
"meshes": [{"primitives": [
  {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0},
  {"attributes": {"POSITION": 3}, "material": 1}]}],
"materials": [
  {"name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.25,
   "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 0.75], "baseColorTexture": {"index": 0}}},
  {"name": "wood"}],
"textures": [{"source": 0, "sampler": 0}],
"samplers": [{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}],
"images": [{"mimeType": "image/png", "bufferView": 3}],
"accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
  {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
  {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC3"}],
"bufferViews": [
  {"buffer": 0, "byteLength": 48},
  {"buffer": 0, "byteOffset": 48, "byteLength": 32},
  {"buffer": 0, "byteOffset": 80, "byteLength": 12},
  {"buffer": 0, "byteOffset": 92, "byteLength": IMAGE}],
"buffers": [{"byteLength": BINARY}]})";
    replaceOnce(json, "IMAGE", std::to_string(imageBytes));
    replaceOnce(json, "BINARY", std::to_string(binaryBytes));
    return json;
}

Bytes packGlb(std::string json, Bytes binary)
{
    json.resize((json.size() + 3) / 4 * 4, ' ');
    binary.resize((binary.size() + 3) / 4 * 4);
    Bytes file;
    appendWord(file, 0x46546c67);
    appendWord(file, 2);
    appendWord(file, 28 + json.size() + binary.size());
    appendWord(file, json.size());
    appendWord(file, 0x4e4f534a);
    file.insert(file.end(), json.begin(), json.end());
    appendWord(file, binary.size());
    appendWord(file, 0x004e4942);
    file.insert(file.end(), binary.begin(), binary.end());
    return file;
}

Bytes cardGlb(const Replacements &replacements)
{
    Bytes binary;
    append<float>(binary, {-1, 0, 0, 1, 0, 0, 1, 2, 0, -1, 2, 0});
    append<float>(binary, {0, 1, 1, 1, 1, 0, 0, 0});
    append<uint16_t>(binary, {0, 1, 2, 0, 2, 3});
    const Bytes png = discPng();
    if (binary.size() != kImageOffset)
        throw std::logic_error("the test's JSON does not fit its binary chunk");
    append(binary, png);
    std::string json = cardJson(png.size(), binary.size());
    for (const auto &[from, to] : replacements)
        replaceOnce(json, from, to);
    return packGlb(json, binary);
}

std::string writeCardGltf(const std::filesystem::path &path, const Bytes &png, const Replacements &replacements)
{
    const Bytes glb = cardGlb(replacements);
    uint32_t length = 0;
    std::memcpy(&length, &glb[12], sizeof length);
    std::string json(glb.begin() + 20, glb.begin() + 20 + length);
    const size_t view = json.rfind("\"byteLength\": ") + 14;
    const auto bytes = static_cast<ptrdiff_t>(std::stoul(json.substr(view)));
    replaceOnce(json, R"("buffers": [{)", R"("buffers": [{"uri": "data.bin", )");
    replaceOnce(json, R"({"mimeType": "image/png", "bufferView": 3})", R"({"uri": "disc.png"})");
    std::filesystem::create_directories(path.parent_path());
    writeFile(path.parent_path() / "data.bin", {glb.begin() + 28 + length, glb.begin() + 28 + length + bytes});
    writeFile(path.parent_path() / "disc.png", png);
    writeFile(path, {json.begin(), json.end()});
    return json;
}

void writeFile(const std::filesystem::path &path, const Bytes &bytes)
{
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!file)
        throw std::runtime_error(path.string() + " cannot be written");
}

Bytes readFile(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    if (!file)
        throw std::runtime_error(path.string() + " cannot be read");
    return {std::istreambuf_iterator<char>(file), {}};
}

std::string readText(const std::filesystem::path &path)
{
    const Bytes bytes = readFile(path);
    return {bytes.begin(), bytes.end()};
}

TemporaryFolder::TemporaryFolder()
{
    std::random_device random;
    do
        path_ = std::filesystem::temp_directory_path() / ("vellum-test-" + std::to_string(random()));
    while (!std::filesystem::create_directory(path_));
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
}

TemporaryFolder::~TemporaryFolder()
{
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

} // namespace vellum::test
