// SPDX-License-Identifier: Apache-2.0
// The names of the settings, and of variables with the same prefixes, for the layer and for the command.
#pragma once

#include <algorithm>
#include <cctype>
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
