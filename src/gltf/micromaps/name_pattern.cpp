// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/name_pattern.h"

#include <string>

#include "gltf/file/utf8.h"

namespace vellum
{
namespace
{

std::u32string codePoints(std::string_view text)
{
    std::u32string points;
    while (!text.empty())
        points += takeCodePoint(text);
    return points;
}

// A character, after the backslash if there is one.
char32_t takeCharacter(std::u32string_view &pattern)
{
    if (pattern[0] == U'\\' && pattern.size() > 1)
        pattern.remove_prefix(1);
    const char32_t character = pattern[0];
    pattern.remove_prefix(1);
    return character;
}

// `pattern` begins after the bracket, and loses the set. A bracket that none closes is a character.
bool matchesSet(char32_t character, std::u32string_view &pattern)
{
    std::u32string_view set = pattern;
    const bool inverted = !set.empty() && (set[0] == U'!' || set[0] == U'^');
    if (inverted)
        set.remove_prefix(1);
    bool found = false;
    for (bool first = true; !set.empty() && (first || set[0] != U']'); first = false) {
        const char32_t low = takeCharacter(set);
        char32_t high = low;
        if (set.size() > 1 && set[0] == U'-' && set[1] != U']') {
            set.remove_prefix(1);
            high = takeCharacter(set);
        }
        found = found || (low <= character && character <= high);
    }
    if (set.empty())
        return character == U'[';
    pattern = set.substr(1);
    return found != inverted;
}

// What begins the pattern and is not *.
bool matchesOne(char32_t character, std::u32string_view &pattern)
{
    if (pattern[0] != U'?' && pattern[0] != U'[')
        return takeCharacter(pattern) == character;
    const bool any = pattern[0] == U'?';
    pattern.remove_prefix(1);
    return any || matchesSet(character, pattern);
}

} // namespace

bool matchesPattern(std::string_view name, std::string_view pattern)
{
    const std::u32string namePoints = codePoints(name);
    const std::u32string patternPoints = codePoints(pattern);
    std::u32string_view rest = namePoints;
    std::u32string_view ahead = patternPoints;
    // After the last *: the pattern, and where in the name it has been tried.
    std::u32string_view afterStar;
    std::u32string_view tried;
    bool star = false;
    while (!rest.empty() || !ahead.empty()) {
        if (!ahead.empty() && ahead[0] == U'*') {
            ahead.remove_prefix(1);
            star = true;
            afterStar = ahead;
            tried = rest;
            continue;
        }
        if (!rest.empty() && !ahead.empty() && matchesOne(rest[0], ahead)) {
            rest.remove_prefix(1);
            continue;
        }
        if (!star || tried.empty())
            return false;
        tried.remove_prefix(1);
        rest = tried;
        ahead = afterStar;
    }
    return true;
}

} // namespace vellum
