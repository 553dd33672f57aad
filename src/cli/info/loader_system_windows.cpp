// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fstream>

#include "base/windows_text.h"
#include "cli/info/loader_system.h"
#include "core/registry_windows.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

namespace fs = std::filesystem;

// Devices that show pictures, and software that belongs to devices: drivers name their manifests there.
constexpr const wchar_t *kDeviceClasses[] = {
    L"SYSTEM\\CurrentControlSet\\Control\\Class\\{4d36e968-e325-11ce-bfc1-08002be10318}",
    L"SYSTEM\\CurrentControlSet\\Control\\Class\\{5c4c3332-344d-483c-8739-259e934c9cc8}",
};

class Key
{
public:
    Key(HKEY parent, const std::wstring &name) { RegOpenKeyExW(parent, name.c_str(), 0, KEY_READ, &key_); }
    ~Key()
    {
        if (key_ != nullptr)
            RegCloseKey(key_);
    }
    Key(const Key &) = delete;
    Key &operator=(const Key &) = delete;

    [[nodiscard]] std::vector<std::wstring> keys() const
    {
        std::vector<std::wstring> names;
        wchar_t name[256];
        DWORD size = static_cast<DWORD>(std::size(name));
        while (RegEnumKeyExW(key_, static_cast<DWORD>(names.size()), name, &size, nullptr, nullptr, nullptr, nullptr) ==
               ERROR_SUCCESS) {
            names.emplace_back(name, size);
            size = static_cast<DWORD>(std::size(name));
        }
        return names;
    }
    // A text, or several with an end each.
    [[nodiscard]] std::vector<std::wstring> texts(const wchar_t *name) const
    {
        DWORD bytes = 0;
        constexpr DWORD kTypes = RRF_RT_REG_SZ | RRF_RT_REG_MULTI_SZ;
        if (RegGetValueW(key_, nullptr, name, kTypes, nullptr, nullptr, &bytes) != ERROR_SUCCESS)
            return {};
        std::wstring all(bytes / sizeof(wchar_t) + 1, L'\0');
        RegGetValueW(key_, nullptr, name, kTypes, nullptr, all.data(), &bytes);
        std::vector<std::wstring> found;
        for (const wchar_t *text = all.c_str(); *text != L'\0'; text += found.back().size() + 1)
            found.emplace_back(text);
        return found;
    }

private:
    HKEY key_ = nullptr;
};

std::vector<ManifestPlace> placesOfDevices(const wchar_t *value)
{
    std::vector<ManifestPlace> places;
    for (const wchar_t *name : kDeviceClasses) {
        const Key devices(HKEY_LOCAL_MACHINE, name);
        for (const std::wstring &device : devices.keys())
            for (const std::wstring &text : Key(HKEY_LOCAL_MACHINE, name + (L"\\" + device)).texts(value))
                places.push_back({text, utf8(L"HKLM\\" + std::wstring(name) + L"\\" + device)});
    }
    return places;
}

WORD ownMachine()
{
    const auto *image = reinterpret_cast<const std::byte *>(GetModuleHandleW(nullptr));
    const auto *dos = reinterpret_cast<const IMAGE_DOS_HEADER *>(image);
    return reinterpret_cast<const IMAGE_NT_HEADERS *>(image + dos->e_lfanew)->FileHeader.Machine;
}

} // namespace

// "Driver Discovery on Windows" and "Layer Discovery" in the loader's documentation list them.
std::vector<ManifestPlace> systemPlaces(ManifestKind kind)
{
    const bool drivers = kind == ManifestKind::Driver;
    std::vector<ManifestPlace> places = placesOfDevices(drivers ? L"VulkanDriverName" : L"VulkanExplicitLayers");
    const std::wstring key = std::wstring(L"SOFTWARE\\Khronos\\Vulkan\\") + (drivers ? L"Drivers" : L"ExplicitLayers");
    for (const auto &[root, name] : {std::pair(HKEY_LOCAL_MACHINE, L"HKLM\\"), std::pair(HKEY_CURRENT_USER, L"HKCU\\")})
        for (const std::wstring &manifest : registeredFiles(root, key.c_str()))
            places.push_back({manifest, utf8(name + key)});
    return places;
}

// A DLL for this program's kind of processor.
std::string problemOfFormat(const fs::path &library)
{
    std::ifstream file(library, std::ios::binary);
    IMAGE_DOS_HEADER dos{};
    IMAGE_NT_HEADERS headers{}; // of which the first fields are those of every processor
    constexpr std::streamsize kFirstFields = sizeof headers.Signature + sizeof headers.FileHeader;
    if (!file.read(reinterpret_cast<char *>(&dos), sizeof dos) || dos.e_magic != IMAGE_DOS_SIGNATURE ||
        !file.seekg(dos.e_lfanew) || !file.read(reinterpret_cast<char *>(&headers), kFirstFields) ||
        headers.Signature != IMAGE_NT_SIGNATURE)
        return "its library " + utf8Text(library) + " is not a DLL, or cannot be read";
    if (headers.FileHeader.Machine != ownMachine())
        return "its library " + utf8Text(library) + " is for another kind of processor than this program";
    return "";
}

// Khronos' loader lists folders by functions that take text of the system's code page, to which it passes UTF-8.
std::string problemOfListing(const fs::path &manifest)
{
    const std::wstring folder = fs::absolute(manifest).parent_path().wstring();
    return std::ranges::all_of(folder, [](wchar_t c) { return c < 0x80; })
               ? ""
               : "Khronos' loader cannot list its folder, whose path has letters outside ASCII";
}

std::string problemOfLoading(const fs::path &library)
{
    const HMODULE module =
        LoadLibraryExW(library.c_str(), nullptr, library.is_absolute() ? LOAD_WITH_ALTERED_SEARCH_PATH : 0);
    if (module == nullptr)
        return "its library cannot be loaded: " + utf8Text(library) + ": " + lastMessage();
    FreeLibrary(module);
    return "";
}

bool isRelativeToManifest(const std::string &library)
{
    return library.find_first_of("/\\") != std::string::npos;
}

std::string commandToSet(const std::string &variable, const std::string &value, bool keepOld)
{
    return "set \"" + variable + "=" + value + (keepOld ? ";%" + variable + "%" : "") + "\"";
}

} // namespace vellum::cli
