// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/selection.h"

#include <algorithm>
#include <charconv>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

// The number at the front of `text`, which loses it. Throws where there is none.
uint32_t takeNumber(std::string_view &text)
{
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc())
        throw Error("");
    text.remove_prefix(static_cast<size_t>(end - text.data()));
    return number;
}

} // namespace

std::vector<NumberRange> parseRanges(const std::string &text, const std::string &option)
{
    try {
        std::vector<NumberRange> ranges;
        std::string_view rest = text;
        while (true) {
            NumberRange range;
            range.first = range.last = takeNumber(rest);
            if (rest.starts_with('-')) {
                rest.remove_prefix(1);
                range.last = takeNumber(rest);
            }
            if (range.last < range.first)
                throw Error("");
            ranges.push_back(range);
            if (rest.empty())
                return ranges;
            if (!rest.starts_with(','))
                throw Error("");
            rest.remove_prefix(1);
        }
    } catch (const Error &) {
        throw UsageError(option + " must be a number, a range like 3-9, or several with commas, got " + text);
    }
}

bool contains(const std::vector<NumberRange> &ranges, uint32_t number)
{
    return ranges.empty() || std::any_of(ranges.begin(), ranges.end(), [&](const NumberRange &range) {
               return range.first <= number && number <= range.last;
           });
}

bool Selection::hasMaterial(int index, const std::string &name) const
{
    return materials.empty() || std::any_of(materials.begin(), materials.end(), [&](const std::string &wanted) {
               return wanted == name || wanted == std::to_string(index);
           });
}

bool Selection::everything() const
{
    return meshes.empty() && primitives.empty() && triangles.empty() && materials.empty();
}

} // namespace vellum::cli
