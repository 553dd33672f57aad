#include "gltf/file/outside_file.h"

#include <algorithm>
#include <array>
#include <fstream>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

constexpr std::uintmax_t kMostBytes = 0x7fffffff;

int hexDigit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    if (c >= 'A' && c <= 'F')
        return c - 'A' + 10;
    return -1;
}

// A percent sign that is not followed by two digits is itself: not every program encodes the names it writes.
std::string percentDecoded(std::string_view text)
{
    std::string decoded;
    decoded.reserve(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && hexDigit(text[i + 1]) >= 0 && hexDigit(text[i + 2]) >= 0) {
            decoded += static_cast<char>(16 * hexDigit(text[i + 1]) + hexDigit(text[i + 2]));
            i += 2;
        } else {
            decoded += text[i];
        }
    }
    return decoded;
}

// "https:" and the like. One letter before the colon is no scheme that anything has.
bool hasScheme(std::string_view uri)
{
    const std::size_t colon = uri.find(':');
    return colon != std::string_view::npos && colon > 0 && uri.substr(0, colon).find_first_of("/?#%") == colon;
}

constexpr std::uint8_t kNoDigit = 64;

constexpr std::array<std::uint8_t, 256> base64Digits()
{
    std::array<std::uint8_t, 256> digits{};
    digits.fill(kNoDigit);
    constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (std::size_t i = 0; i < kAlphabet.size(); ++i)
        digits[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::uint8_t>(i);
    return digits;
}

std::vector<std::uint8_t> base64Decoded(std::string_view text)
{
    static constexpr std::array<std::uint8_t, 256> kDigits = base64Digits();
    while (text.ends_with('='))
        text.remove_suffix(1);
    std::vector<std::uint8_t> bytes;
    bytes.reserve(text.size() / 4 * 3 + 2);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const std::uint8_t digit = kDigits[static_cast<unsigned char>(text[i])];
        if (digit == kNoDigit)
            throw GltfError("character " + std::to_string(i) + " of its base64 text is none of base64's");
        bits = bits << 6 | digit;
        if (i % 4 != 0)
            bytes.push_back(static_cast<std::uint8_t>(bits >> (6 - 2 * (i % 4))));
    }
    if (text.size() % 4 == 1)
        throw GltfError("its base64 text is cut off");
    return bytes;
}

} // namespace

std::vector<std::uint8_t> readWholeFile(const std::filesystem::path &path)
{
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status))
        throw GltfError("no such file");
    if (!std::filesystem::is_regular_file(status))
        throw GltfError("not a file");
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (error)
        throw GltfError("cannot be read");
    if (size > kMostBytes)
        throw GltfError("larger than 2 GiB");
    std::ifstream file(path, std::ios::binary);
    std::vector<std::uint8_t> bytes(size);
    file.read(reinterpret_cast<char *>(bytes.data()), static_cast<std::streamsize>(size));
    if (!file || static_cast<std::uintmax_t>(file.gcount()) != size)
        throw GltfError("cannot be read");
    return bytes;
}

std::filesystem::path fileOfUri(const std::filesystem::path &folder, std::string_view uri)
{
    if (uri.empty())
        throw GltfError("the URI is empty");
    if (hasScheme(uri))
        throw GltfUnsupported("the URI is not a relative path");
    const std::string name = percentDecoded(uri);
    if (name.find('\0') != std::string::npos)
        throw GltfError("the URI has a NUL character");
    const std::filesystem::path path(name);
    if (path.is_absolute())
        throw GltfUnsupported("the URI is not a relative path");
    if (std::find(path.begin(), path.end(), "..") != path.end())
        throw GltfUnsupported("the URI leads out of the file's folder");
    return folder / path;
}

bool isDataUri(std::string_view uri)
{
    return uri.starts_with("data:");
}

DataUri readDataUri(std::string_view uri)
{
    const std::size_t comma = uri.find(',');
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
