// SPDX-License-Identifier: Apache-2.0
// Text and bytes in the forms that a web page takes them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum::cli
{

// A zlib stream (RFC 1950), which DecompressionStream("deflate") reads. Throws Error.
std::vector<uint8_t> deflated(std::span<const uint8_t> bytes);

// Text of an element or of an attribute in double quotes; what is no UTF-8 becomes U+FFFD.
std::string htmlText(std::string_view text);

} // namespace vellum::cli
