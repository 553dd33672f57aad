// SPDX-License-Identifier: Apache-2.0
#include "cli/base/variables.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/process.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{

namespace
{

constexpr std::string_view kName = "VELLUM_";
// Before the keys of settings, the longest first.
constexpr std::array<std::string_view, 3> kPrefixes = {"VK_VELLUM_OPACITY_MICROMAP_", "VK_VELLUM_", kName};

// Of "VELLUM_VALIDTE": the name that was meant is near; the reason why nothing reads it. Others with the prefix may be
// another program's.
std::string problemOfKey(const std::string &name, std::string_view prefix)
{
    const auto isNear = [key = std::string_view(name).substr(prefix.size())](const std::string &known) {
        return isMisspelling(key, known);
    };
    return std::ranges::any_of(layer::variableKeys(prefix), isNear) ? layer::problemOfVariable(name, prefix)
                                                                    : std::string();
}

// The variable that was meant by one such as "VELUM_VALIDATE", "vellum_validate" or "VELLUM-VALIDATE", whose prefix is
// not that of settings; empty if it is another program's.
std::string meantByPrefix(const std::string &name)
{
    std::string text = layer::inCapitals(name);
    std::ranges::replace(text, '-', '_');
    const std::string start = text.starts_with("VK_") ? "VK_" : "";
    const size_t end = text.find('_', start.size());
    if (end == std::string::npos)
        return {};
    const std::string word = text.substr(start.size(), end + 1 - start.size());
    // A second wrong letter only where the first is right: HELIUM_ is another word.
    const size_t most = word.front() == kName.front() ? 2 : 1;
    if (editDistance(word, kName) > most)
        return {};
    const std::string prefix = start + std::string(kName);
    const std::string key = text.substr(end + 1);
    for (const std::string &known : layer::variableKeys(prefix))
        if (key == known || (word == kName && isMisspelling(key, known)))
            return prefix + known;
    return {};
}

} // namespace

std::vector<std::string> misspeltVariables()
{
    std::vector<std::string> problems;
    for (const std::string &name : variableNames()) {
        const auto *const prefix =
            std::ranges::find_if(kPrefixes, [&](std::string_view known) { return name.starts_with(known); });
        if (prefix != kPrefixes.end()) {
            if (std::string problem = problemOfKey(name, *prefix); !problem.empty())
                problems.push_back(std::move(problem));
            continue;
        }
        const std::string meant = meantByPrefix(name);
        // If it is set to the same, it is read. On Windows, it is the same variable in other letters.
        if (!meant.empty() && variable(meant.c_str()) != variable(name.c_str()))
            problems.push_back("nothing reads " + name + "; did you mean " + meant + "?");
    }
    return problems;
}

} // namespace vellum::cli
