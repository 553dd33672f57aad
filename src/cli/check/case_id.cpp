// SPDX-License-Identifier: Apache-2.0
#include "cli/check/case_id.h"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>

#include "base/text.h"
#include "core/hash.h"

namespace vellum::cli
{
namespace
{

std::optional<uint32_t> parseNumber(std::string_view text)
{
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size() || fmt::format("{:04}", number) != text)
        return std::nullopt;
    return number;
}

} // namespace

const char *nameOf(check::Api api)
{
    return api == check::Api::Khr ? "khr" : "ext";
}

std::string nameOf(check::Api api, const check::Group &group)
{
    return fmt::format("{}.{}", nameOf(api), group.name);
}

std::string nameOf(const CaseId &id)
{
    return fmt::format("{}.{:04}", nameOf(id.api, *id.group), id.number);
}

const check::Group *findGroup(std::string_view name)
{
    const auto groups = check::groups();
    const auto found =
        std::find_if(groups.begin(), groups.end(), [&](const check::Group &g) { return g.name == name; });
    return found != groups.end() ? &*found : nullptr;
}

std::optional<CaseId> parseCase(std::string_view name)
{
    const size_t first = name.find('.');
    const size_t last = name.rfind('.');
    if (first == last || (name.substr(0, first) != "khr" && name.substr(0, first) != "ext"))
        return std::nullopt;
    const check::Group *group = findGroup(name.substr(first + 1, last - first - 1));
    const std::optional<uint32_t> number = parseNumber(name.substr(last + 1));
    if (group == nullptr || !number)
        return std::nullopt;
    return CaseId{name.starts_with("khr") ? check::Api::Khr : check::Api::Ext, group, *number};
}

bool anyCase(const std::function<bool(const std::string &name)> &accepts)
{
    constexpr uint32_t kMostNumbers = 10000;
    const auto inRange = [&](bool beyond) {
        for (const check::Api api : {check::Api::Khr, check::Api::Ext})
            for (const check::Group &group : check::groups())
                for (uint32_t number = beyond ? group.cases : 0; number < (beyond ? kMostNumbers : group.cases);
                     ++number)
                    if (accepts(nameOf({api, &group, number})))
                        return true;
        return false;
    };
    return inRange(false) || inRange(true);
}

uint64_t seedOf(uint64_t seed, const CaseId &id)
{
    Hash hash;
    for (const char c : nameOf(id))
        hash.add(static_cast<uint8_t>(c));
    for (int byte = 0; byte < 8; ++byte)
        hash.add(seed >> (8 * byte) & 0xff);
    // The finalizer of SplitMix64: seeds of neighbours have nothing in common.
    uint64_t mixed = hash.value();
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9u;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebu;
    mixed ^= mixed >> 31;
    // The seed alone then determines the kind.
    const uint64_t kinds = id.group->kinds;
    return kinds == 1 ? mixed : mixed / 2 / kinds * kinds + id.number % kinds;
}

} // namespace vellum::cli
