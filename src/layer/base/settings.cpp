#include "layer/base/settings.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mutex>
#include <optional>
#include <set>
#include <variant>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

#include "layer/base/pnext.h"
#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{
namespace
{

constexpr const char *kFilePrefix = "vellum_opacity_micromap.";

// A setting is called by its key in structures, in files with kFilePrefix before it, and in capitals with
// kVariablePrefix, or that after VK_, in the environment. The manifest and docs/settings.md list the same
// (tests/structure/check_settings.py).
struct Row {
    const char *key;
    std::variant<bool Settings::*, ReportLevel Settings::*, std::string Settings::*> member;
};
constexpr Row kRows[] = {
    {"force_emulation", &Settings::forceEmulation},
    {"report", &Settings::report},
    {"validate", &Settings::validate},
    {"strict", &Settings::strict},
    {"assume_micromaps", &Settings::assumeMicromaps},
    {"constant_ray_flags", &Settings::constantRayFlags},
    {"cache_folder", &Settings::cacheFolder},
    {"dump_shaders", &Settings::dumpShaders},
    {"report_file", &Settings::reportFile},
};

// Variables that begin like those of settings: of the project's tests, of libvellum's module for Python, and of
// `vellum run`.
constexpr const char *kOtherVariables[] = {"TEST_", "ORACLE_", "STRESS", "LOWER_", "FORCING", "LIBRARY", "FAIL_ON"};

constexpr std::pair<const char *, ReportLevel> kLevels[] = {
    {"none", ReportLevel::None},    {"error", ReportLevel::Error}, {"warning", ReportLevel::Warning},
    {"warn", ReportLevel::Warning}, {"info", ReportLevel::Info},   {"0", ReportLevel::None},
    {"off", ReportLevel::None},     {"false", ReportLevel::None},  {"1", ReportLevel::Info},
    {"on", ReportLevel::Info},      {"true", ReportLevel::Info},
};
constexpr std::pair<const char *, bool> kBooleans[] = {
    {"true", true}, {"false", false}, {"1", true}, {"0", false}, {"on", true}, {"off", false},
};

// Prints what is wrong with the settings, each thing once in the life of the process: they are read before there is a
// messenger, and may turn messages off.
void reportOnce(const std::string &text)
{
    static std::mutex mutex;
    static auto &printed = *new std::set<std::string>; // never destroyed: instances may be created by exit handlers
    std::lock_guard lock(mutex);
    if (printed.insert(text).second)
        std::fprintf(stderr, "vellum: %sVELLUM-setting: %s\n", kMessagePrefix, text.c_str());
}

std::string trimmed(const std::string &text)
{
    const size_t first = text.find_first_not_of(" \t\r");
    if (first == std::string::npos)
        return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::string inCapitals(std::string text)
{
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return text;
}

template <typename Value, size_t count>
std::optional<Value> named(const std::pair<const char *, Value> (&values)[count], const std::string &text)
{
    const auto found =
        std::ranges::find_if(values, [&](const auto &value) { return inCapitals(value.first) == inCapitals(text); });
    return found == std::end(values) ? std::nullopt : std::optional(found->second);
}

// A setting as someone gave it.
struct Given {
    std::string key;
    std::string origin;
    std::string value;

    [[nodiscard]] std::string is(const std::string &found) const { return key + " is " + found + " (" + origin + ")"; }
};

template <typename Value, size_t count>
void assign(Value &setting, const std::pair<const char *, Value> (&values)[count], const Given &given,
            const char *expected)
{
    if (const std::optional<Value> value = named(values, given.value))
        setting = *value;
    else
        reportOnce(given.is("\"" + given.value + "\"") + " and must be " + expected + "; the setting is ignored");
}

void apply(Settings &settings, const Row &row, const Given &given)
{
    if (const auto *text = std::get_if<std::string Settings::*>(&row.member))
        settings.**text = given.value;
    else if (given.value.empty())
        return;
    else if (const auto *level = std::get_if<ReportLevel Settings::*>(&row.member))
        assign(settings.**level, kLevels, given, "error, warning, info or none");
    else
        assign(settings.*std::get<bool Settings::*>(row.member), kBooleans, given, "1, true, on, 0, false or off");
}

// Null, after a report, where there is no such setting.
const Row *rowOf(const Given &given)
{
    const auto found = std::ranges::find_if(kRows, [&](const Row &row) { return given.key == row.key; });
    if (found != std::end(kRows))
        return &*found;
    reportOnce("there is no setting " + given.key + " (" + given.origin + ")");
    return nullptr;
}

// By the XDG Base Directory Specification. Nowhere in programs that run with more rights than their user has.
std::string userCacheFolder()
{
    if (const char *folder = secure_getenv("XDG_CACHE_HOME"); folder && *folder == '/')
        return std::string(folder) + "/vellum";
    if (const char *home = secure_getenv("HOME"); home && *home == '/')
        return std::string(home) + "/.cache/vellum";
    return {};
}

bool isFile(const std::string &path)
{
    struct stat status {
    };
    return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

// Of the files that there are, the first of: the one that VK_LAYER_SETTINGS_PATH names; that of the user, which Vulkan
// Configurator writes; that in the working directory; that of the machine. Empty if there is none.
std::string settingsFile()
{
    const std::string name = "vk_layer_settings.txt";
    const std::string below = "vulkan/settings.d/";
    if (const char *path = std::getenv("VK_LAYER_SETTINGS_PATH"); path && *path) {
        for (const std::string &file : {std::string(path), path + ("/" + name)}) {
            if (isFile(file))
                return file;
        }
        reportOnce("VK_LAYER_SETTINGS_PATH is \"" + std::string(path) +
                   "\" and must be a file of settings, or a folder with one");
    }
    std::vector<std::string> folders;
    if (const char *data = secure_getenv("XDG_DATA_HOME"); data && *data == '/')
        folders.push_back(data + ("/" + below));
    else if (const char *home = secure_getenv("HOME"); home && *home == '/')
        folders.push_back(home + ("/.local/share/" + below));
    folders.insert(folders.end(), {"", "/etc/" + below});
    for (const std::string &folder : folders) {
        if (isFile(folder + name))
            return folder + name;
    }
    return {};
}

// An empty value there, as Configurator writes where its user gives none, is no value.
void readFile(Settings &settings)
{
    const std::string path = settingsFile();
    std::ifstream file(path);
    for (std::string line; !path.empty() && std::getline(file, line);) {
        line = trimmed(line.substr(0, line.find('#')));
        const size_t equals = line.find('=');
        if (equals == std::string::npos || line.rfind(kFilePrefix, 0) != 0)
            continue;
        const size_t begin = std::strlen(kFilePrefix);
        const Given given{trimmed(line.substr(begin, equals - begin)), path, trimmed(line.substr(equals + 1))};
        const Row *row = rowOf(given);
        if (row && !given.value.empty())
            apply(settings, *row, given);
    }
}

void readStructures(Settings &settings, const void *chain)
{
    const auto find = [](const void *from) {
        return findInChain<newer::LayerSettingsCreateInfo>(from, newer::kLayerSettingsCreateInfo);
    };
    for (const auto *info = find(chain); info; info = find(info->pNext)) {
        for (uint32_t i = 0; i < info->settingCount; ++i) {
            const newer::LayerSetting &setting = info->pSettings[i];
            if (std::strcmp(setting.pLayerName, kLayerName) != 0)
                continue;
            Given given{setting.pSettingName, "VkLayerSettingEXT", {}};
            const Row *row = rowOf(given);
            if (!row || setting.valueCount == 0)
                continue;
            const bool isText = std::holds_alternative<std::string Settings::*>(row->member);
            if (setting.type == newer::kLayerSettingString)
                given.value = *static_cast<const char *const *>(setting.pValues);
            else if (setting.type == newer::kLayerSettingBool32 && !isText)
                given.value = *static_cast<const VkBool32 *>(setting.pValues) ? "true" : "false";
            else {
                reportOnce(given.is("of type " + std::to_string(setting.type)) + " and must be of type " +
                           (isText ? "STRING" : "BOOL32 or STRING") + "; the setting is ignored");
                continue;
            }
            apply(settings, *row, given);
        }
    }
}

void readVariables(Settings &settings)
{
    const std::string prefix = kVariablePrefix;
    for (const std::string &before : {"VK_" + prefix, prefix}) {
        for (const Row &row : kRows) {
            const std::string name = before + inCapitals(row.key);
            if (const char *value = std::getenv(name.c_str()))
                apply(settings, row, {row.key, name, value});
        }
        for (char **variable = environ; variable && *variable; ++variable) {
            const std::string name(*variable, std::strcspn(*variable, "="));
            if (!name.starts_with(before))
                continue;
            const std::string key = name.substr(before.size());
            const bool isSetting =
                std::ranges::any_of(kRows, [&](const Row &row) { return key == inCapitals(row.key); });
            if (!isSetting &&
                std::ranges::none_of(kOtherVariables, [&](const char *other) { return key.starts_with(other); }))
                reportOnce("there is no setting " + name);
        }
    }
}

} // namespace

Settings readSettings(const void *instanceChain)
{
    Settings settings;
    settings.cacheFolder = userCacheFolder();
    readFile(settings);
    readStructures(settings, instanceChain);
    readVariables(settings);
    return settings;
}

} // namespace vellum::layer
