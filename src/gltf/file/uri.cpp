// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/uri.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>
#include <system_error>

#include "base/text.h"
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"

namespace vellum
{
namespace
{

bool isKept(unsigned char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-._~/").find(static_cast<char>(c)) != std::string_view::npos;
}

int hexDigit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

// `lower` is ASCII in lower case.
bool equalsInAnyCase(std::string_view text, std::string_view lower)
{
    return std::equal(text.begin(), text.end(), lower.begin(), lower.end(),
                      [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

void collect(const JsonValue &value, std::vector<std::filesystem::path> &paths)
{
    if (value.isArray())
        for (const JsonValue &element : value.children())
            collect(element, paths);
    for (const auto &[name, member] : value.members())
        if (name.string() == "uri") {
            if (const auto path = decodedUri(member.string().value_or("")))
                paths.push_back(*path);
        } else if (name.string() != "extras") {
            collect(member, paths);
        }
}

} // namespace

std::string encodedUri(std::string_view name)
{
    std::string uri;
    while (!name.empty()) {
        const size_t sequence = utf8Sequence(name);
        if (sequence > 1 || isKept(static_cast<unsigned char>(name[0]))) {
            uri += name.substr(0, sequence);
            name.remove_prefix(sequence);
            continue;
        }
        char escape[4];
        std::snprintf(escape, sizeof escape, "%%%02X", static_cast<unsigned>(static_cast<unsigned char>(name[0])));
        uri += escape;
        name.remove_prefix(1);
    }
    return uri;
}

std::string percentDecoded(std::string_view text)
{
    std::string decoded;
    decoded.reserve(text.size());
    for (size_t i = 0; i < text.size(); ++i) {
        const int high = text[i] == '%' && i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
        const int low = high >= 0 ? hexDigit(text[i + 2]) : -1;
        decoded += low >= 0 ? static_cast<char>(16 * high + low) : text[i];
        if (low >= 0)
            i += 2;
    }
    return decoded;
}

std::optional<std::filesystem::path> decodedUri(std::string_view uri)
{
    // RFC 3986: a scheme ends at the first colon, in front of any slash.
    const size_t colon = uri.find_first_of(":/");
    if (uri.empty() || (colon != std::string_view::npos && uri[colon] == ':'))
        return std::nullopt;
    const std::string path = percentDecoded(uri);
    if (path.find('\0') != std::string::npos)
        return std::nullopt;
    try {
        return utf8Path(path);
    } catch (const std::system_error &) {
        return std::nullopt; // no UTF-8, of which this system's names cannot be made
    }
}

bool leadsOut(const std::filesystem::path &normal)
{
    return normal.has_root_path() || *normal.begin() == "..";
}

std::vector<std::filesystem::path> namedFiles(const JsonValue &root)
{
    std::vector<std::filesystem::path> paths;
    collect(root, paths);
    return paths;
}

namespace
{

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

// `file` and `folder` must not contain links.
bool isIn(const std::filesystem::path &file, const std::filesystem::path &folder)
{
    // Windows ends the path of a drive's root folder, \\?\D:\, with a separator: an empty last component.
    const auto end = folder.has_relative_path() && !folder.has_filename() ? std::prev(folder.end()) : folder.end();
    return !folder.empty() && std::mismatch(folder.begin(), end, file.begin(), file.end()).first == end;
}

std::vector<uint8_t> readAll(InputFile &file)
{
    checkSize(file.size());
    std::vector<uint8_t> bytes(static_cast<size_t>(file.size()));
    if (file.read(bytes) != bytes.size())
        throw GltfError("cannot be read");
    return bytes;
}

} // namespace

void checkSize(uint64_t bytes)
{
    constexpr uint64_t kMostBytes = 0x7fffffff;
    if (bytes > kMostBytes)
        throw GltfError("larger than 2 GiB");
}

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
    const std::filesystem::path normal = path->lexically_normal();
    if (leadsOut(normal))
        throw GltfUnsupported("the URI leads out of the file's folder");
    return folder / normal;
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
    return equalsInAnyCase(uri.substr(0, 5), "data:");
}

DataUri readDataUri(std::string_view uri)
{
    const size_t comma = uri.find(',');
    if (comma == std::string_view::npos)
        throw GltfError("the data URI has no comma");
    const std::string_view header = uri.substr(5, comma - 5);
    const std::string text = percentDecoded(uri.substr(comma + 1));
    DataUri data{.mimeType = std::string(header.substr(0, header.find(';'))), .bytes = {}};
    if (const size_t parameter = header.rfind(';');
        parameter != std::string_view::npos && equalsInAnyCase(header.substr(parameter), ";base64"))
        data.bytes = base64Decoded(text);
    else
        data.bytes.assign(text.begin(), text.end());
    return data;
}

} // namespace vellum
