// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <dlfcn.h>
#include <elf.h>
#include <fstream>

#include "base/process.h"
#include "base/text.h"
#include "cli/info/loader_system.h"
#include "core/utf8_path.h"

namespace vellum::cli
{

namespace fs = std::filesystem;

// "Driver Discovery on Linux" in the loader's documentation lists them.
std::vector<ManifestPlace> systemPlaces(ManifestKind kind)
{
    const std::string home = variable("HOME").value_or("");
    std::vector<ManifestPlace> places;
    const auto add = [&](const fs::path &base) {
        const fs::path folder = base / "vulkan" / (kind == ManifestKind::Driver ? "icd.d" : "explicit_layer.d");
        if (std::none_of(places.begin(), places.end(), [&](const ManifestPlace &p) { return p.path == folder; }))
            places.push_back({folder, utf8Text(folder)});
    };
    const auto addFrom = [&](const char *name, const std::string &standard) {
        const std::string value = variable(name).value_or("");
        add(value.empty() ? standard : value);
    };
    const auto addEach = [&](const char *name, const std::string &standard) {
        std::vector<std::string> folders = partsOf(variable(name).value_or(""), kListSeparator);
        for (const std::string &folder : folders.empty() ? partsOf(standard, kListSeparator) : folders)
            add(folder);
    };
    addFrom("XDG_CONFIG_HOME", home + "/.config");
    addEach("XDG_CONFIG_DIRS", "/etc/xdg");
    add("/usr/local/etc");
    add("/etc");
    addFrom("XDG_DATA_HOME", home + "/.local/share");
    addEach("XDG_DATA_DIRS", "/usr/local/share:/usr/share");
    add("/usr/local/share");
    add("/usr/share");
    return places;
}

// An ELF library of this program's kind of processor and word size.
std::string problemOfFormat(const fs::path &library)
{
    std::ifstream file(library, std::ios::binary);
    Elf64_Ehdr header{}; // of which the first fields are those of Elf32_Ehdr
    if (!file.read(reinterpret_cast<char *>(&header), 20) || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0)
        return "its library " + utf8Text(library) + " is not a shared library, or cannot be read";
    Elf64_Ehdr own{};
    std::ifstream self("/proc/self/exe", std::ios::binary);
    if (!self.read(reinterpret_cast<char *>(&own), 20))
        return "";
    if (header.e_ident[EI_CLASS] != own.e_ident[EI_CLASS] || header.e_machine != own.e_machine)
        return "its library " + utf8Text(library) + " is for another kind of processor than this program";
    return "";
}

std::string problemOfListing(const fs::path &)
{
    return "";
}

std::string problemOfLoading(const fs::path &library)
{
    void *handle = dlopen(library.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (handle != nullptr) {
        dlclose(handle);
        return "";
    }
    const char *error = dlerror();
    return "its library cannot be loaded: " + std::string(error != nullptr ? error : utf8Text(library));
}

bool isRelativeToManifest(const std::string &library)
{
    return library.find('/') != std::string::npos;
}

std::string commandToSet(const std::string &variable, const std::string &value, bool keepOld)
{
    return "export " + variable + "=" + shellWord(value) + (keepOld ? ":$" + variable : "");
}

} // namespace vellum::cli
