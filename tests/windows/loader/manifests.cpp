// SPDX-License-Identifier: Apache-2.0
#include "manifests.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include <rapidjson/document.h>
#include <windows.h>

namespace vellum::loader
{
namespace
{

std::wstring variable(const wchar_t *name)
{
    std::wstring value(GetEnvironmentVariableW(name, nullptr, 0), L'\0');
    value.resize(GetEnvironmentVariableW(name, value.data(), static_cast<DWORD>(value.size())));
    return value;
}

template <size_t size>
void copyText(char (&target)[size], const std::string &text)
{
    std::snprintf(target, size, "%s", text.c_str());
}

uint32_t versionOf(const std::string &text)
{
    unsigned major = 0;
    unsigned minor = 0;
    unsigned patch = 0;
    std::sscanf(text.c_str(), "%u.%u.%u", &major, &minor, &patch);
    return VK_MAKE_API_VERSION(0, major, minor, patch);
}

std::vector<VkExtensionProperties> extensionsOf(const rapidjson::Value &layer, const char *kind)
{
    std::vector<VkExtensionProperties> extensions;
    if (!layer.HasMember(kind))
        return extensions;
    for (const rapidjson::Value &extension : layer[kind].GetArray()) {
        copyText(extensions.emplace_back().extensionName, extension["name"].GetString());
        extensions.back().specVersion = versionOf("0.0." + std::string(extension["spec_version"].GetString()));
    }
    return extensions;
}

Manifest readManifest(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(file), {});
    rapidjson::Document document;
    document.Parse(text.c_str());
    const rapidjson::Value &layer = document["layer"];
    Manifest manifest;
    copyText(manifest.properties.layerName, layer["name"].GetString());
    copyText(manifest.properties.description, layer["description"].GetString());
    manifest.properties.specVersion = versionOf(layer["api_version"].GetString());
    manifest.properties.implementationVersion =
        versionOf("0.0." + std::string(layer["implementation_version"].GetString()));
    manifest.library = path.parent_path() / layer["library_path"].GetString();
    manifest.instanceExtensions = extensionsOf(layer, "instance_extensions");
    manifest.deviceExtensions = extensionsOf(layer, "device_extensions");
    return manifest;
}

} // namespace

std::vector<Manifest> findManifests()
{
    std::wstring folders = variable(L"VK_LAYER_PATH");
    if (folders.empty())
        folders = variable(L"VK_ADD_LAYER_PATH");
    std::vector<Manifest> manifests;
    std::wistringstream list(folders);
    for (std::wstring folder; std::getline(list, folder, L';');) {
        std::error_code ignored;
        std::vector<std::filesystem::path> paths;
        for (const auto &entry : std::filesystem::directory_iterator(folder, ignored)) {
            if (entry.path().extension() == ".json")
                paths.push_back(entry.path());
        }
        std::ranges::sort(paths);
        for (const std::filesystem::path &path : paths)
            manifests.push_back(readManifest(path));
    }
    return manifests;
}

std::vector<std::string> layersByVariable()
{
    std::vector<std::string> names;
    std::wistringstream list(variable(L"VK_INSTANCE_LAYERS"));
    for (std::wstring name; std::getline(list, name, L';');)
        names.push_back(std::filesystem::path(name).string());
    return names;
}

} // namespace vellum::loader
