// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/utf8.h"

namespace vellum
{

size_t utf8Sequence(std::string_view text)
{
    const auto byteAt = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const auto isTail = [&](size_t i) { return byteAt(i) >= 0x80 && byteAt(i) <= 0xbf; };
    const unsigned first = byteAt(0);
    const unsigned second = byteAt(1);
    if (text.empty() || (first >= 0x80 && first < 0xc2) || first > 0xf4)
        return 0;
    if (first < 0x80)
        return 1;
    if (!isTail(1))
        return 0;
    if (first < 0xe0)
        return 2;
    // Neither longer than need be, nor a surrogate, nor beyond U+10FFFF.
    const bool outside = (first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
                         (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f);
    if (outside || !isTail(2))
        return 0;
    if (first < 0xf0)
        return 3;
    return isTail(3) ? 4 : 0;
}

char32_t takeCodePoint(std::string_view &text)
{
    constexpr char32_t kReplacement = 0xfffd;
    const size_t length = utf8Sequence(text);
    const auto first = static_cast<unsigned char>(text[0]);
    char32_t point = length == 0 ? kReplacement : length == 1 ? first : first & (0x7fu >> length);
    for (size_t i = 1; i < length; ++i)
        point = point << 6 | (static_cast<unsigned char>(text[i]) & 0x3fu);
    text.remove_prefix(length == 0 ? 1 : length);
    return point;
}

} // namespace vellum
