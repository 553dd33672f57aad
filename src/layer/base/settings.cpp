// SPDX-License-Identifier: Apache-2.0
#include "layer/base/settings.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <span>
#include <sstream>
#include <variant>
#include <vector>

#include "core/utf8_path.h"
#include "layer/base/pnext.h"
#include "layer/base/setting_names.h"
#include "layer/base/system.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

constexpr const char *kFilePrefix = "vellum_opacity_micromap.";

struct Row {
    const char *key;
    std::variant<bool Settings::*, uint32_t Settings::*, Checks Settings::*, ReportLevel Settings::*,
                 Preferred Settings::*, std::string Settings::*>
        member;
};
#define VELLUM_ROW(key, member, type, initial, label, description) {#key, &Settings::member},
constexpr Row kRows[] = {VELLUM_SETTINGS(VELLUM_ROW)};
#undef VELLUM_ROW

#define VELLUM_LEVEL(name, value, label, description) {#name, ReportLevel::value},
constexpr std::pair<const char *, ReportLevel> kLevels[] = {
    VELLUM_REPORT_LEVELS(VELLUM_LEVEL) // their names, and what users may write instead
    {"warn", ReportLevel::Warning},
    {"0", ReportLevel::None},
    {"off", ReportLevel::None},
    {"false", ReportLevel::None},
    {"1", ReportLevel::Info},
    {"on", ReportLevel::Info},
    {"true", ReportLevel::Info},
};
#undef VELLUM_LEVEL
#define VELLUM_IMPLEMENTATION(name, value, label, description) {#name, Preferred::value},
constexpr std::pair<const char *, Preferred> kImplementations[] = {VELLUM_IMPLEMENTATIONS(VELLUM_IMPLEMENTATION)};
#undef VELLUM_IMPLEMENTATION
#define VELLUM_CHECK(name, member, label, description) {#name, &Checks::member},
constexpr std::pair<const char *, bool Checks::*> kChecks[] = {VELLUM_CHECKS(VELLUM_CHECK)};
#undef VELLUM_CHECK

std::string trimmed(const std::string &text)
{
    const size_t first = text.find_first_not_of(" \t\r");
    if (first == std::string::npos)
        return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

// Several values of a setting, as files have them.
std::string joined(std::span<const char *const> values)
{
    std::string all;
    for (const char *value : values)
        all += (all.empty() ? "" : ",") + std::string(value);
    return all;
}

template <typename Value, size_t count>
std::optional<Value> named(const std::pair<const char *, Value> (&values)[count], const std::string &text)
{
    const auto found =
        std::ranges::find_if(values, [&](const auto &value) { return inCapitals(value.first) == inCapitals(text); });
    return found == std::end(values) ? std::nullopt : std::optional(found->second);
}

// A setting as it was found in one of the sources.
struct Given {
    std::string key;
    std::string origin;
    std::string value;

    [[nodiscard]] std::string is(const std::string &found) const { return key + " is " + found + " (" + origin + ")"; }
};

// Returns whether the setting is a limit of subdivision levels.
bool isLevel(uint32_t Settings::*setting)
{
    return setting == &Settings::most2StateLevel || setting == &Settings::most4StateLevel ||
           setting == &Settings::mostLossyLevel;
}

// The prefixes of environment variables, from the weakest to the strongest. The first is the one that
// Vulkan-Utility-Libraries derives from the name of the layer.
std::array<std::string, 3> variablePrefixes()
{
    const std::string layer = kLayerName + std::strlen("VK_LAYER_");
    return {"VK_" + inCapitals(layer) + "_", std::string("VK_") + kVariablePrefix, kVariablePrefix};
}

// Reads the sources one after the other.
class SettingsReader
{
public:
    Settings read(const void *instanceChain)
    {
        settings_.cacheFolder = userCacheFolder();
        readFile();
        readStructures(instanceChain);
        readVariables();
        return std::move(settings_);
    }

private:
    void fault(const std::string &text) { settings_.faults.push_back(text); }

    // Returns whether the value is one.
    template <typename Value, size_t count>
    bool assign(Value &setting, const std::pair<const char *, Value> (&values)[count], const Given &given,
                const char *expected)
    {
        const std::optional<Value> value = named(values, given.value);
        if (value)
            setting = *value;
        else
            wrongWord(given, expected);
        return value.has_value();
    }

    void assignBoolean(bool &setting, const Given &given)
    {
        if (const std::optional<bool> value = booleanOf(given.value))
            setting = *value;
        else
            wrongWord(given, kBooleanWords);
    }

    void wrongWord(const Given &given, const char *expected)
    {
        fault(given.is("\"" + given.value + "\"") + " and must be " + expected + "; the setting is ignored");
    }

    // Names with commas; or all, none, or a boolean for these.
    void assignChecks(Checks &setting, const Given &given)
    {
        Checks checks;
        std::istringstream names(given.value);
        for (std::string name; std::getline(names, name, ',');) {
            name = trimmed(name);
            const auto check = named(kChecks, name);
            const std::optional<bool> every = inCapitals(name) == "ALL"    ? true
                                              : inCapitals(name) == "NONE" ? false
                                                                           : booleanOf(name);
            if (!check && !every) {
                fault(given.is("\"" + given.value + "\"") +
                      " and must be core, gpu, sync, several of them with commas, all or none; the setting is ignored");
                return;
            }
            if (check)
                checks.*(*check) = true;
            else
                for (const auto &[key, member] : kChecks)
                    checks.*member = *every;
        }
        setting = checks;
    }

    void assignNumber(uint32_t &setting, const Given &given, bool level)
    {
        constexpr uint32_t kLeastLevel = 3; // Required Limits
        uint32_t number = 0;
        const char *end = given.value.data() + given.value.size();
        const auto [rest, error] = std::from_chars(given.value.data(), end, number);
        if (error != std::errc() || rest != end)
            fault(given.is("\"" + given.value + "\"") + " and must be a number; the setting is ignored");
        else if (level && number != 0 && number < kLeastLevel)
            fault(given.is(given.value) + " and must be at least 3, as on every device; the setting is ignored");
        else
            setting = number;
    }

    void apply(const Row &row, const Given &given)
    {
        if (const auto *text = std::get_if<std::string Settings::*>(&row.member))
            settings_.**text = given.value;
        else if (given.value.empty())
            return;
        else if (const auto *level = std::get_if<ReportLevel Settings::*>(&row.member))
            settings_.reportIsGiven |= assign(settings_.**level, kLevels, given, "error, warning, info or none");
        else if (const auto *preferred = std::get_if<Preferred Settings::*>(&row.member))
            assign(settings_.**preferred, kImplementations, given, "auto, driver, ext or emulated");
        else if (const auto *checks = std::get_if<Checks Settings::*>(&row.member))
            assignChecks(settings_.**checks, given);
        else if (const auto *number = std::get_if<uint32_t Settings::*>(&row.member))
            assignNumber(settings_.**number, given, isLevel(*number));
        else
            assignBoolean(settings_.*std::get<bool Settings::*>(row.member), given);
    }

    // Null after a message if there is no such setting.
    const Row *rowOf(const Given &given)
    {
        const auto found = std::ranges::find_if(kRows, [&](const Row &row) { return given.key == row.key; });
        if (found != std::end(kRows))
            return &*found;
        fault("there is no setting " + given.key + " (" + given.origin + ")" + suggestion(given.key, settingKeys()));
        return nullptr;
    }

    // An empty value in a file leaves the setting alone: Vulkan Configurator writes one for each setting without a
    // value.
    void readFile()
    {
        const std::string path = settingsFile([this](const std::string &text) { fault(text); });
        std::ifstream file(utf8Path(path));
        for (std::string line; !path.empty() && std::getline(file, line);) {
            if (line.starts_with("\xef\xbb\xbf")) // the mark of UTF-8 by which editors of Windows begin a file
                line.erase(0, 3);
            line = trimmed(line.substr(0, line.find('#')));
            const size_t equals = line.find('=');
            if (equals == std::string::npos || line.rfind(kFilePrefix, 0) != 0)
                continue;
            const size_t begin = std::strlen(kFilePrefix);
            const Given given{trimmed(line.substr(begin, equals - begin)), path, trimmed(line.substr(equals + 1))};
            const Row *row = rowOf(given);
            if (row && !given.value.empty())
                apply(*row, given);
        }
    }

    void readStructures(const void *chain)
    {
        const auto find = [](const void *from) {
            return findInChain<VkLayerSettingsCreateInfoEXT>(from, VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT);
        };
        for (const auto *info = find(chain); info; info = find(info->pNext)) {
            for (uint32_t i = 0; i < info->settingCount; ++i) {
                const VkLayerSettingEXT &setting = info->pSettings[i];
                if (std::strcmp(setting.pLayerName, kLayerName) != 0)
                    continue;
                Given given{setting.pSettingName, "VkLayerSettingEXT", {}};
                const Row *row = rowOf(given);
                if (!row || setting.valueCount == 0)
                    continue;
                const bool isText = std::holds_alternative<std::string Settings::*>(row->member);
                if (setting.type == VK_LAYER_SETTING_TYPE_STRING_EXT)
                    given.value = joined({static_cast<const char *const *>(setting.pValues), setting.valueCount});
                else if (setting.type == VK_LAYER_SETTING_TYPE_BOOL32_EXT && !isText)
                    given.value = *static_cast<const VkBool32 *>(setting.pValues) ? "true" : "false";
                else if (setting.type == VK_LAYER_SETTING_TYPE_UINT32_EXT &&
                         std::holds_alternative<uint32_t Settings::*>(row->member))
                    given.value = std::to_string(*static_cast<const uint32_t *>(setting.pValues));
                else {
                    fault(given.is("of type " + std::to_string(setting.type)) + " and must be of type " +
                          (isText ? "STRING" : "BOOL32 or STRING") + "; the setting is ignored");
                    continue;
                }
                apply(*row, given);
            }
        }
    }

    void reportUnknownVariables(const std::array<std::string, 3> &prefixes)
    {
        for (const std::string &name : environmentNames()) {
            const auto prefix =
                std::ranges::find_if(prefixes, [&name](const std::string &p) { return name.starts_with(p); });
            const std::string problem = prefix != prefixes.end() ? problemOfVariable(name, *prefix) : std::string();
            if (!problem.empty())
                fault(problem);
        }
    }

    void readVariables()
    {
        const std::array<std::string, 3> prefixes = variablePrefixes();
        for (const std::string &prefix : prefixes) {
            for (const Row &row : kRows) {
                const std::string name = prefix + inCapitals(row.key);
                if (const std::optional<std::string> value = environmentVariable(name))
                    apply(row, {row.key, name, *value});
            }
        }
        reportUnknownVariables(prefixes);
    }

    Settings settings_;
};

} // namespace

Settings readSettings(const void *instanceChain)
{
    return SettingsReader().read(instanceChain);
}

} // namespace vellum::layer
