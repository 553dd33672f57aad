// SPDX-License-Identifier: Apache-2.0
// The names of the settings, and of variables with the same prefixes, for the layer and for the command.
#pragma once

#include <algorithm>
#include <cctype>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/nearest.h"
#include "layer/base/settings_table.h"

namespace vellum::layer
{

inline std::string inCapitals(std::string text)
{
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return text;
}

inline constexpr const char *kBooleanWords = "1, true, on, yes, 0, false, off or no";

// Nothing for other words than these; case does not matter.
inline std::optional<bool> booleanOf(const std::string &word)
{
    const std::string name = inCapitals(word);
    if (name == "1" || name == "TRUE" || name == "ON" || name == "YES")
        return true;
    if (name == "0" || name == "FALSE" || name == "OFF" || name == "NO")
        return false;
    return std::nullopt;
}

// The parts of validation that are on, "core, gpu"; "none". `Checks`: that of settings.h.
template <typename Checks>
std::string namesOf(const Checks &checks)
{
    std::string names;
#define VELLUM_NAME(name, member, label, description)                                                                  \
    if (checks.member)                                                                                                 \
        names += (names.empty() ? "" : ", ") + std::string(#name);
    VELLUM_CHECKS(VELLUM_NAME)
#undef VELLUM_NAME
    return names.empty() ? "none" : names;
}

// In the order of settings_table.h, as files and structures have them.
inline std::vector<std::string> settingKeys()
{
#define VELLUM_KEY(key, member, type, initial, label, description) #key,
    return {VELLUM_SETTINGS(VELLUM_KEY)};
#undef VELLUM_KEY
}

// The names that follow a prefix of variables: settings, and with VELLUM_ those of the command and the Python package.
inline std::vector<std::string> variableKeys(std::string_view prefix)
{
    std::vector<std::string> keys = settingKeys();
    std::ranges::transform(keys, keys.begin(), inCapitals);
    if (prefix == "VELLUM_")
        keys.insert(keys.end(), {"CACHE", "FAIL_ON", "LIBRARY_PATH", "REQUIRE_CHECKS"});
    return keys;
}

// Why nothing reads the variable of that name: "there is no setting VELLUM_VALIDTE; did you mean VELLUM_VALIDATE?".
// Empty for one of variableKeys() or of the tests. `prefix` is the part before the key.
inline std::string problemOfVariable(const std::string &name, std::string_view prefix)
{
    const std::string_view key = std::string_view(name).substr(prefix.size());
    for (const char *ofTests : {"TEST_", "ORACLE_", "STRESS", "LOWER_", "FORCING"})
        if (key.starts_with(ofTests))
            return {};
    const std::vector<std::string> keys = variableKeys(prefix);
    if (std::ranges::find(keys, key) != keys.end())
        return {};
    const std::string nearest = nearestWord(key, keys);
    return "there is no setting " + name +
           (nearest.empty() ? "" : "; did you mean " + std::string(prefix) + nearest + "?");
}

} // namespace vellum::layer
