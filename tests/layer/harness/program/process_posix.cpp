// SPDX-License-Identifier: Apache-2.0
#include "harness/program/process.h"

#include <array>
#include <barrier>
#include <cstdlib>
#include <thread>

#include <dlfcn.h>
#include <sys/personality.h>
#include <unistd.h>

namespace
{

// The layer writes addresses of its tables into shaders. Where these are the same in every device and process, most
// shaders of a test were compiled for another one before and are in lavapipe's cache. For that the kernel may not
// choose addresses at random, and nothing may lie at changing places between the mappings of device memory: blocks of
// malloc, stacks of threads. Where this is not allowed, tests take longer.
[[maybe_unused]] void makeAddressesRepeat(char **argv)
{
    constexpr const char *kDone = "VELLUM_TEST_ADDRESSES_REPEAT";
    if (std::getenv(kDone) == nullptr) {
        const int now = personality(0xffffffff);
        if (now == -1 || personality(static_cast<unsigned long>(now) | ADDR_NO_RANDOMIZE) == -1)
            return;
        setenv(kDone, "1", 1);
        // The C library reads these when a program starts.
        setenv("GLIBC_TUNABLES", "glibc.pthread.stack_cache_size=1073741824", 1);
        setenv("MALLOC_ARENA_MAX", "1", 1);
        setenv("MALLOC_MMAP_MAX_", "0", 1);
        execv("/proc/self/exe", argv);
        return;
    }
    unsetenv(kDone);
    // Later threads reuse the stacks of these.
    std::array<std::thread, 32> threads;
    std::barrier all(static_cast<ptrdiff_t>(threads.size()));
    for (std::thread &thread : threads)
        thread = std::thread([&all] { all.arrive_and_wait(); });
    for (std::thread &thread : threads)
        thread.join();
}

// ThreadSanitizer ends the process when a library goes that a suppression names (tests/tsan.supp), and knows no names
// of functions in others that have gone.
[[maybe_unused]] void keepLibrariesLoaded(const std::string &folders)
{
    for (const std::string &name : {std::string("libvulkan_lvp.so"),
                                    folders.substr(0, folders.find(':')) + "/libVkLayer_vellum_opacity_micromap.so"})
        dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
}

} // namespace

namespace vt
{

void prepareProcess([[maybe_unused]] char **argv, [[maybe_unused]] const std::string &layerFolders)
{
#if defined(__SANITIZE_THREAD__)
    keepLibrariesLoaded(layerFolders);
#elif !defined(__SANITIZE_ADDRESS__)
    makeAddressesRepeat(argv);
#endif
}

} // namespace vt
