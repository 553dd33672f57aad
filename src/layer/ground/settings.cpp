#include "layer/ground/settings.h"

#include <cstdlib>
#include <cstring>
#include <fstream>

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

bool isTrue(const std::string &value)
{
    return value == "1" || value == "true" || value == "TRUE" || value == "on";
}

ReportLevel reportLevel(const std::string &value)
{
    if (value == "error")
        return ReportLevel::Error;
    if (value == "warning" || value == "warn")
        return ReportLevel::Warning;
    if (value == "info" || value == "1" || value == "true")
        return ReportLevel::Info;
    return ReportLevel::None;
}

void apply(Settings &settings, const std::string &key, const std::string &value)
{
    if (key == "force_emulation")
        settings.forceEmulation = isTrue(value);
    else if (key == "validate")
        settings.validate = isTrue(value);
    else if (key == "assume_micromaps")
        settings.assumeMicromaps = isTrue(value);
    else if (key == "constant_ray_flags")
        settings.constantRayFlags = isTrue(value);
    else if (key == "strict")
        settings.strict = isTrue(value);
    else if (key == "report")
        settings.report = reportLevel(value);
    else if (key == "dump_shaders")
        settings.dumpShaders = value;
    else if (key == "cache_folder")
        settings.cacheFolder = value;
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
