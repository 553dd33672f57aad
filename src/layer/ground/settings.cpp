#include "layer/ground/settings.h"

#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <utility>

#include <sys/stat.h>

#include "layer/ground/pnext.h"
#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{
namespace
{

constexpr const char *kFilePrefix = "vellum_opacity_micromap.";

std::string trimmed(const std::string &text)
{
    const std::size_t first = text.find_first_not_of(" \t\r");
    if (first == std::string::npos)
        return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

struct Switch {
    const char *key;
    bool Settings::*setting;
};
constexpr Switch kSwitches[] = {
    {"force_emulation", &Settings::forceEmulation},      {"validate", &Settings::validate},
    {"assume_micromaps", &Settings::assumeMicromaps},
    {"constant_ray_flags", &Settings::constantRayFlags}, {"strict", &Settings::strict}};

struct Text {
    const char *key;
    std::string Settings::*setting;
};
constexpr Text kTexts[] = {{"dump_shaders", &Settings::dumpShaders}, {"cache_folder", &Settings::cacheFolder}};

// The settings are read before there is a messenger, and may turn messages off.
void reportWrong(const std::string &text)
{
    std::fprintf(stderr, "vellum: %sVELLUM-setting: %s\n", kMessagePrefix, text.c_str());
}

template <typename Value>
void choose(Value &setting, const std::string &key, std::string value, const char *expected,
            std::initializer_list<std::pair<const char *, Value>> values)
{
    for (char &c : value)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const auto &[name, meaning] : values) {
        if (value != name)
            continue;
        setting = meaning;
        return;
    }
    reportWrong(key + " is \"" + value + "\" and must be " + expected + "; the setting is ignored");
}

void apply(Settings &settings, const std::string &key, const std::string &value)
{
    for (const Switch &one : kSwitches) {
        if (key == one.key)
            return choose<bool>(settings.*one.setting, key, value, "1, true, on, 0, false or off",
                                {{"1", true},
                                 {"true", true},
                                 {"on", true},
                                 {"0", false},
                                 {"false", false},
                                 {"off", false},
                                 {"", false}});
    }
    for (const Text &one : kTexts) {
        if (key == one.key) {
            settings.*one.setting = value;
            return;
        }
    }
    if (key != "report")
        return reportWrong("there is no setting " + key);
    choose<ReportLevel>(settings.report, key, value, "error, warning, info or none",
                        {{"error", ReportLevel::Error},
                         {"warning", ReportLevel::Warning},
                         {"warn", ReportLevel::Warning},
                         {"info", ReportLevel::Info},
                         {"1", ReportLevel::Info},
                         {"true", ReportLevel::Info},
                         {"none", ReportLevel::None},
                         {"off", ReportLevel::None},
                         {"0", ReportLevel::None},
                         {"false", ReportLevel::None},
                         {"", ReportLevel::None}});
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

std::string settingsFile()
{
    const char *path = std::getenv("VK_LAYER_SETTINGS_PATH");
    if (!path || !*path)
        return "vk_layer_settings.txt";
    struct stat status {
    };
    const bool folder = stat(path, &status) == 0 && S_ISDIR(status.st_mode);
    return folder ? std::string(path) + "/vk_layer_settings.txt" : path;
}

void readFile(Settings &settings)
{
    std::ifstream file(settingsFile());
    for (std::string line; std::getline(file, line);) {
        line = trimmed(line.substr(0, line.find('#')));
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos || line.rfind(kFilePrefix, 0) != 0)
            continue;
        const std::size_t start = std::strlen(kFilePrefix);
        apply(settings, trimmed(line.substr(start, equals - start)), trimmed(line.substr(equals + 1)));
    }
}

void readStructure(Settings &settings, const void *instanceChain)
{
    const auto *info = findInChain<newer::LayerSettingsCreateInfo>(instanceChain, newer::kLayerSettingsCreateInfo);
    for (uint32_t i = 0; info && i < info->settingCount; ++i) {
        const newer::LayerSetting &setting = info->pSettings[i];
        if (std::strcmp(setting.pLayerName, kLayerName) != 0 || setting.valueCount == 0)
            continue;
        if (setting.type == newer::kLayerSettingBool32)
            apply(settings, setting.pSettingName, *static_cast<const VkBool32 *>(setting.pValues) ? "true" : "false");
        else if (setting.type == newer::kLayerSettingString)
            apply(settings, setting.pSettingName, *static_cast<const char *const *>(setting.pValues));
    }
}

} // namespace

Settings readSettings(const void *instanceChain)
{
    Settings settings;
    settings.cacheFolder = userCacheFolder();
    readFile(settings);
    readStructure(settings, instanceChain);
    const std::pair<const char *, const char *> variables[] = {
        {"FORCE_EMULATION", "force_emulation"},
        {"REPORT", "report"},
        {"VALIDATE", "validate"},
        {"ASSUME_MICROMAPS", "assume_micromaps"},
        {"STRICT", "strict"},
        {"CONSTANT_RAY_FLAGS", "constant_ray_flags"},
        {"DUMP_SHADERS", "dump_shaders"},
        {"CACHE_FOLDER", "cache_folder"},
    };
    for (const auto &[variable, key] : variables) {
        if (const char *value = std::getenv((std::string(kVariablePrefix) + variable).c_str()))
            apply(settings, key, value);
    }
    return settings;
}

} // namespace vellum::layer
