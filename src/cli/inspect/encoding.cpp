// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/encoding.h"

#include <fmt/format.h>
#include <zlib.h>

#include "cli/base/error.h"
#include "gltf/file/utf8.h"

namespace vellum::cli
{
namespace
{

constexpr char32_t kReplacement = 0xfffd;

} // namespace

std::vector<uint8_t> deflated(std::span<const uint8_t> bytes)
{
    uLongf size = compressBound(static_cast<uLong>(bytes.size()));
    std::vector<uint8_t> result(size);
    if (compress2(result.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), 6) != Z_OK)
        throw Error("the data of the page cannot be compressed");
    result.resize(size);
    return result;
}

std::string htmlText(std::string_view text)
{
    std::string result;
    while (!text.empty()) {
        const char32_t point = takeCodePoint(text);
        if (point < 0x20 || point >= 0x7f ||
            std::string_view("\"<>&'").find(static_cast<char>(point)) != std::string_view::npos)
            // No control characters: a parser takes these references for others or for errors.
            result += fmt::format(
                "&#{};", static_cast<uint32_t>(point < 0x20 || (point >= 0x7f && point < 0xa0) ? kReplacement : point));
        else
            result += static_cast<char>(point);
    }
    return result;
}

} // namespace vellum::cli
