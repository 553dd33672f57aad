// SPDX-License-Identifier: Apache-2.0
// Functions of the mock driver (layers/) for tests.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <dlfcn.h>

namespace vt
{

#ifdef _WIN32
constexpr char kListSeparator = ';'; // of folders in the environment
constexpr const char *kLibrarySuffix = ".dll";
#else
constexpr char kListSeparator = ':';
constexpr const char *kLibrarySuffix = ".so";
#endif

// True if all tests of this process run with that quirk.
inline bool chosenQuirk(const std::string &name)
{
    const char *chosen = std::getenv("VELLUM_TEST_QUIRKS");
    return chosen != nullptr && (std::string(",") + chosen + ',').find(',' + name + ',') != std::string::npos;
}

// True if all tests of this process run where the layer translates VK_KHR_opacity_micromap.
inline bool translatedTests()
{
    return chosenQuirk("ext") && std::getenv("VELLUM_IMPLEMENTATION") == nullptr;
}

// A function of the library in that file, by its name. The loader has loaded the library from one of the folders of
// VK_ADD_LAYER_PATH when it created an instance.
template <class Function>
Function testDriverFunction(const char *name, const std::string &stem = "libvellum_test_mock_driver")
{
    const std::string folders = std::getenv("VK_ADD_LAYER_PATH");
    const std::string file = stem + kLibrarySuffix;
    for (size_t begin = 0; begin != std::string::npos;) {
        const size_t end = folders.find(kListSeparator, begin);
        const std::string path = folders.substr(begin, end - begin) + '/' + file;
        const std::string real = std::filesystem::exists(path) ? std::filesystem::canonical(path).string() : path;
        if (void *library = dlopen(real.c_str(), RTLD_NOW | RTLD_NOLOAD)) {
            if (void *symbol = dlsym(library, name))
                return reinterpret_cast<Function>(symbol);
        }
        begin = end == std::string::npos ? end : end + 1;
    }
    throw std::runtime_error(file + " is not loaded");
}

} // namespace vt
