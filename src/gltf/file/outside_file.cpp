// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/outside_file.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "base/text.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/input_file.h"
#include "gltf/file/relative_uri.h"

namespace vellum
{
namespace
{

constexpr uintmax_t kMostBytes = 0x7fffffff;

constexpr uint8_t kNoDigit = 64;

constexpr std::array<uint8_t, 256> base64Digits()
{
    std::array<uint8_t, 256> digits{};
    digits.fill(kNoDigit);
    for (size_t i = 0; i < kBase64Alphabet.size(); ++i)
        digits[static_cast<unsigned char>(kBase64Alphabet[i])] = static_cast<uint8_t>(i);
    return digits;
}

std::vector<uint8_t> base64Decoded(std::string_view text)
{
    static constexpr std::array<uint8_t, 256> kDigits = base64Digits();
    while (text.ends_with('='))
        text.remove_suffix(1);
    std::vector<uint8_t> bytes;
    bytes.reserve(text.size() / 4 * 3 + 2);
    uint32_t bits = 0;
    for (size_t i = 0; i < text.size(); ++i) {
        const uint8_t digit = kDigits[static_cast<unsigned char>(text[i])];
        if (digit == kNoDigit)
            throw GltfError("character " + std::to_string(i) + " of its base64 text is not a base64 digit");
        bits = bits << 6 | digit;
        if (i % 4 != 0)
            bytes.push_back(static_cast<uint8_t>(bits >> (6 - 2 * (i % 4))));
    }
    if (text.size() % 4 == 1)
        throw GltfError("its base64 text is cut off");
    return bytes;
}

// Both without links.
bool isIn(const std::filesystem::path &file, const std::filesystem::path &folder)
{
    // Windows ends the path of a drive's root folder, \\?\D:\, with a separator: an empty last component.
    const auto end = folder.has_relative_path() && !folder.has_filename() ? std::prev(folder.end()) : folder.end();
    return !folder.empty() && std::mismatch(folder.begin(), end, file.begin(), file.end()).first == end;
}

std::vector<uint8_t> readAll(InputFile &file)
{
    if (file.size() > kMostBytes)
        throw GltfError("larger than 2 GiB");
    std::vector<uint8_t> bytes(static_cast<size_t>(file.size()));
    if (file.read(bytes) != bytes.size())
        throw GltfError("cannot be read");
    return bytes;
}

} // namespace

std::vector<uint8_t> readWholeFile(const std::filesystem::path &path)
{
    InputFile file(path);
    return readAll(file);
}

std::filesystem::path fileOfUri(const std::filesystem::path &folder, std::string_view uri)
{
    if (uri.empty())
        throw GltfError("the URI is empty");
    const auto path = decodedUri(uri);
    if (!path || path->has_root_path())
        throw GltfUnsupported("the URI is not a relative path");
    if (std::find(path->begin(), path->end(), "..") != path->end())
        throw GltfUnsupported("the URI leads out of the file's folder");
    return folder / *path;
}

std::vector<uint8_t> readFileOfUri(const std::filesystem::path &model, std::string_view uri)
{
    InputFile file(fileOfUri(model.parent_path(), uri));
    file.requireBeside(model);
    return readAll(file);
}

void InputFile::requireBeside(const std::filesystem::path &model) const
{
    const std::filesystem::path real = realPath();
    bool inside = isIn(real, realFolder(model.parent_path()));
    std::error_code error;
    if (!inside && std::filesystem::is_regular_file(model, error))
        inside = isIn(real, InputFile(model).realPath().parent_path());
    if (!inside)
        throw GltfUnsupported("a link leads out of the file's folder");
}

bool isDataUri(std::string_view uri)
{
    return uri.starts_with("data:");
}

DataUri readDataUri(std::string_view uri)
{
    const size_t comma = uri.find(',');
    if (comma == std::string_view::npos)
        throw GltfError("the data URI has no comma");
    const std::string_view header = uri.substr(5, comma - 5);
    const std::string_view text = uri.substr(comma + 1);
    DataUri data{.mimeType = std::string(header.substr(0, header.find(';'))), .bytes = {}};
    if (header.ends_with(";base64")) {
        data.bytes = base64Decoded(text);
    } else {
        const std::string decoded = percentDecoded(text);
        data.bytes.assign(decoded.begin(), decoded.end());
    }
    return data;
}

} // namespace vellum
