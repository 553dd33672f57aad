// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/relative_uri.h"

#include <cstdio>
#include <system_error>

#include "core/utf8_path.h"
#include "base/text.h"

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

void collect(const JsonValue &value, std::vector<std::filesystem::path> &paths)
{
    for (const auto &[name, member] : value.members())
        if (name.string() == "uri")
            if (const auto path = decodedUri(member.string().value_or("")))
                paths.push_back(*path);
    for (const JsonValue &child : value.children())
        collect(child, paths);
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

std::vector<std::filesystem::path> namedFiles(const JsonValue &root)
{
    std::vector<std::filesystem::path> paths;
    collect(root, paths);
    return paths;
}

} // namespace vellum
