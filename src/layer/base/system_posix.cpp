// SPDX-License-Identifier: Apache-2.0
#include "layer/base/system.h"

#include <csignal>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/auxv.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vellum::layer
{
namespace
{

// Implements secure_getenv, which Android's C library lacks.
const char *variableOf(const char *name)
{
    return getauxval(AT_SECURE) == 0 ? std::getenv(name) : nullptr;
}

bool isFile(const std::string &path)
{
    struct stat status {
    };
    return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

} // namespace

std::optional<std::string> environmentVariable(const std::string &name)
{
    const char *value = variableOf(name.c_str());
    return value ? std::optional<std::string>(value) : std::nullopt;
}

std::vector<std::string> environmentNames()
{
    std::vector<std::string> names;
    for (char **variable = environ; variable && *variable; ++variable)
        names.emplace_back(*variable, std::strcspn(*variable, "="));
    return names;
}

std::string processName()
{
    char path[4096];
    const ssize_t length = readlink("/proc/self/exe", path, sizeof path);
    const std::string_view program(path, length > 0 ? static_cast<size_t>(length) : 0);
    return std::string(program.substr(program.rfind('/') + 1)) + " " + std::to_string(getpid());
}

// Follows the XDG Base Directory Specification.
std::string userCacheFolder()
{
    if (const char *folder = variableOf("XDG_CACHE_HOME"); folder && *folder == '/')
        return std::string(folder) + "/vellum";
    if (const char *home = variableOf("HOME"); home && *home == '/')
        return std::string(home) + "/.cache/vellum";
    return {};
}

// The first file that exists of: the one that VK_LAYER_SETTINGS_PATH names; the user's file, which Vulkan Configurator
// writes; the one in the working directory; the one of the machine.
std::string settingsFile(const std::function<void(const std::string &)> &report)
{
    const std::string name = "vk_layer_settings.txt";
    const std::string below = "vulkan/settings.d/";
    if (const char *path = variableOf("VK_LAYER_SETTINGS_PATH"); path && *path) {
        for (const std::string &file : {std::string(path), path + ("/" + name)}) {
            if (isFile(file))
                return file;
        }
        report("VK_LAYER_SETTINGS_PATH is \"" + std::string(path) +
               "\" and must be a file of settings, or a folder with one");
    }
    std::vector<std::string> folders;
    if (const char *data = variableOf("XDG_DATA_HOME"); data && *data == '/')
        folders.push_back(data + ("/" + below));
    else if (const char *home = variableOf("HOME"); home && *home == '/')
        folders.push_back(home + ("/.local/share/" + below));
    if (getauxval(AT_SECURE) == 0)
        folders.push_back(""); // the working directory
    folders.push_back("/etc/" + below);
    for (const std::string &folder : folders) {
        if (isFile(folder + name))
            return folder + name;
    }
    return {};
}

// Only regular files: to write to a pipe may block, or end the program.
bool appendToFile(const std::string &file, std::string_view bytes)
{
    const int descriptor = open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666);
    if (descriptor < 0)
        return false;
    struct stat status;
    const bool regular = fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
    const bool written = regular && write(descriptor, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
    close(descriptor);
    return written;
}

void stopInDebugger()
{
    std::raise(SIGTRAP);
}

void stayLoaded()
{
    static const char ofThisLibrary = 0;
    Dl_info info{};
    if (dladdr(&ofThisLibrary, &info) == 0 || !info.dli_fname)
        return;
    // The flag stays after dlclose.
    if (void *library = dlopen(info.dli_fname, RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE))
        dlclose(library);
}

#if defined(__linux__) && defined(MAP_FIXED_NOREPLACE)

void *mapMemoryAt(void *address, size_t bytes)
{
    void *got = mmap(address, bytes, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED_NOREPLACE, -1, 0);
    if (got == address)
        return got;
    if (got != MAP_FAILED) // by an older kernel, for which the address is a hint
        munmap(got, bytes);
    return nullptr;
}

#else

void *mapMemoryAt(void *, size_t)
{
    return nullptr;
}

#endif

void unmapMemory(void *address, size_t bytes)
{
    munmap(address, bytes);
}

} // namespace vellum::layer
