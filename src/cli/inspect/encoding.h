// Text and bytes in the forms that a web page takes them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum::cli
{

std::string base64(std::span<const std::uint8_t> bytes);

// A zlib stream (RFC 1950), which DecompressionStream("deflate") reads. Throws Error.
std::vector<std::uint8_t> deflated(std::span<const std::uint8_t> bytes);

// A JSON string with its quotes, in ASCII: safe inside of <script>, whatever the text is. What is no UTF-8 becomes
// U+FFFD.
std::string jsonString(std::string_view text);

// Text of an element or of an attribute in double quotes; what is no UTF-8 becomes U+FFFD.
std::string htmlText(std::string_view text);

} // namespace vellum::cli
