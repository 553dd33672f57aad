#include "gltf/file/utf8.h"

namespace vellum
{

std::size_t utf8Sequence(std::string_view text)
{
    const auto byteAt = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const auto isTail = [&](std::size_t i) { return byteAt(i) >= 0x80 && byteAt(i) <= 0xbf; };
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

std::string toUtf8(std::string_view text)
{
    std::string result;
    while (!text.empty()) {
        const std::size_t sequence = utf8Sequence(text);
        result += sequence == 0 ? "\xef\xbf\xbd" : text.substr(0, sequence);
        text.remove_prefix(sequence == 0 ? 1 : sequence);
    }
    return result;
}

} // namespace vellum
