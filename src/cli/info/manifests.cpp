// SPDX-License-Identifier: Apache-2.0
#include "cli/info/manifests.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <elf.h>
#include <fstream>
#include <rapidjson/document.h>

#include "cli/vulkan/layer_path.h"

namespace vellum::cli
{
namespace
{

namespace fs = std::filesystem;

constexpr size_t kMostBytes = 1 << 20;

std::vector<std::string> listOf(const char *variable)
{
    const char *value = std::getenv(variable);
    std::vector<std::string> parts;
    std::string rest = value != nullptr ? value : "";
    while (!rest.empty()) {
        const size_t end = std::min(rest.find(':'), rest.size());
        if (end != 0)
            parts.push_back(rest.substr(0, end));
        rest.erase(0, end + 1);
    }
    return parts;
}

std::string variableOr(const char *variable, const std::string &other)
{
    const char *value = std::getenv(variable);
    return value != nullptr && *value != '\0' ? value : other;
}

// Where the loader looks, as "Driver Discovery on Linux" in its documentation lists them.
std::vector<fs::path> systemFolders(const std::string &name)
{
    const std::string home = variableOr("HOME", "");
    std::vector<fs::path> folders;
    const auto add = [&](const fs::path &base) {
        const fs::path folder = base / "vulkan" / name;
        if (std::find(folders.begin(), folders.end(), folder) == folders.end())
            folders.push_back(folder);
    };
    const auto addEach = [&](const char *variable, const std::string &other) {
        std::vector<std::string> parts = listOf(variable);
        for (std::string rest = other; parts.empty() && !rest.empty();) {
            const size_t end = std::min(rest.find(':'), rest.size());
            add(rest.substr(0, end));
            rest.erase(0, end + 1);
        }
        for (const std::string &part : parts)
            add(part);
    };
    add(variableOr("XDG_CONFIG_HOME", home + "/.config"));
    addEach("XDG_CONFIG_DIRS", "/etc/xdg");
    add("/usr/local/etc");
    add("/etc");
    add(variableOr("XDG_DATA_HOME", home + "/.local/share"));
    addEach("XDG_DATA_DIRS", "/usr/local/share:/usr/share");
    add("/usr/local/share");
    add("/usr/share");
    return folders;
}

std::vector<fs::path> manifestsIn(const fs::path &folder)
{
    std::vector<fs::path> found;
    std::error_code error;
    for (const auto &entry : fs::directory_iterator(folder, error))
        if (entry.path().extension() == ".json")
            found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
}

// An ELF library of this program's kind of processor and word size.
std::string problemOfLibrary(const fs::path &library)
{
    std::error_code error;
    if (!fs::exists(library, error))
        return "its library " + library.string() + " does not exist";
    std::ifstream file(library, std::ios::binary);
    Elf64_Ehdr header{}; // of which the first fields are those of Elf32_Ehdr
    if (!file.read(reinterpret_cast<char *>(&header), 20) || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0)
        return "its library " + library.string() + " is not a shared library, or cannot be read";
    Elf64_Ehdr own{};
    std::ifstream self("/proc/self/exe", std::ios::binary);
    if (!self.read(reinterpret_cast<char *>(&own), 20))
        return "";
    if (header.e_ident[EI_CLASS] != own.e_ident[EI_CLASS] || header.e_machine != own.e_machine)
        return "its library " + library.string() + " is for another kind of processor than this program";
    return "";
}

// As the loader loads it: what it depends on may be missing.
std::string problemOfLoading(const fs::path &library)
{
    void *handle = dlopen(library.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (handle != nullptr) {
        dlclose(handle);
        return "";
    }
    const char *error = dlerror();
    return "its library cannot be loaded: " + std::string(error != nullptr ? error : library.string());
}

// Finds the library of a manifest whose object `kind` has a library_path.
void readManifest(Manifest &manifest, const char *kind)
{
    std::ifstream file(manifest.path, std::ios::binary);
    std::string text(kMostBytes, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<size_t>(file.gcount()));
    if (text.empty()) {
        manifest.problem = "it cannot be read";
        return;
    }
    rapidjson::Document json;
    json.Parse<rapidjson::kParseIterativeFlag>(text.data(), text.size());
    const bool has = !json.HasParseError() && json.IsObject() && json.HasMember(kind) && json[kind].IsObject() &&
                     json[kind].HasMember("library_path") && json[kind]["library_path"].IsString();
    if (!has) {
        manifest.problem = std::string("it is not a manifest: there is no library_path of its \"") + kind + "\"";
        return;
    }
    manifest.library = json[kind]["library_path"].GetString();
    // A path with a slash is relative to the manifest; a bare name is for the system's search.
    if (manifest.library.string().find('/') != std::string::npos) {
        manifest.library = (manifest.path.parent_path() / manifest.library).lexically_normal();
        manifest.problem = problemOfLibrary(manifest.library);
    }
    if (manifest.problem.empty())
        manifest.problem = problemOfLoading(manifest.library);
}

bool namesLayer(const fs::path &path)
{
    std::ifstream file(path, std::ios::binary);
    std::string text(kMostBytes, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    return text.find(kLayerName) != std::string::npos;
}

} // namespace

std::vector<Manifest> findDriverManifests()
{
    std::vector<Manifest> manifests;
    const auto addNamed = [&](const char *variable) {
        for (const std::string &part : listOf(variable)) {
            std::error_code error;
            if (fs::is_directory(part, error))
                for (const fs::path &path : manifestsIn(part))
                    manifests.push_back({path, {}, variable, ""});
            else
                manifests.push_back({part, {}, variable, fs::exists(part, error) ? "" : "it does not exist"});
        }
    };
    const char *chosen = std::getenv("VK_DRIVER_FILES") != nullptr    ? "VK_DRIVER_FILES"
                         : std::getenv("VK_ICD_FILENAMES") != nullptr ? "VK_ICD_FILENAMES"
                                                                      : nullptr;
    if (chosen != nullptr)
        addNamed(chosen);
    else
        for (const fs::path &folder : systemFolders("icd.d"))
            for (const fs::path &path : manifestsIn(folder))
                manifests.push_back({path, {}, folder.string(), ""});
    addNamed("VK_ADD_DRIVER_FILES");
    for (Manifest &manifest : manifests)
        if (manifest.problem.empty())
            readManifest(manifest, "ICD");
    return manifests;
}

std::vector<Manifest> findLayerManifests(const fs::path &folder)
{
    struct Place {
        fs::path folder;
        std::string from;
    };
    std::vector<Place> places;
    const auto addNamed = [&](const char *variable) {
        for (const std::string &part : listOf(variable))
            places.push_back({part, variable});
    };
    if (std::getenv("VK_LAYER_PATH") != nullptr) {
        addNamed("VK_LAYER_PATH"); // and nothing else
    } else {
        addNamed("VK_ADD_LAYER_PATH");
        for (const fs::path &system : systemFolders("explicit_layer.d"))
            places.push_back({system, system.string()});
    }
    if (!folder.empty())
        places.push_back({folder, "the folder beside this program"});
    std::vector<Manifest> manifests;
    for (const Place &place : places) {
        std::vector<fs::path> candidates = manifestsIn(place.folder);
        if (place.folder.extension() == ".json") // newer loaders also take files
            candidates = {place.folder};
        for (const fs::path &path : candidates) {
            const bool known = std::any_of(manifests.begin(), manifests.end(), [&](const Manifest &m) {
                std::error_code error;
                return fs::equivalent(m.path, path, error);
            });
            if (known || !namesLayer(path))
                continue;
            manifests.push_back({path, {}, place.from, ""});
            readManifest(manifests.back(), "layer");
        }
    }
    return manifests;
}

} // namespace vellum::cli
