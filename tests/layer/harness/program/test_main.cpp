// SPDX-License-Identifier: Apache-2.0
// The tests' main: lets the loader find the layer of this build tree, and pins the driver, whatever the environment
// says. Most of what the tests cost is lavapipe compiling shaders, so it also sees to it that lavapipe compiles each
// only once, and does not optimize.
#include <array>
#include <barrier>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include <dlfcn.h>
#include <sys/personality.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "check/oracle/outcome.h"
#include "harness/program/labels.h"

#if defined(__SANITIZE_ADDRESS__)
// Blocks that libraries which are not ours leave behind. Lavapipe 25 leaks one for each vkCmdBindVertexBuffers2 with a
// size, for instance. Only a function that is visible replaces the sanitizer's.
extern "C" __attribute__((visibility("default"))) const char *__lsan_default_suppressions();
extern "C" const char *__lsan_default_suppressions()
{
    return "leak:libvulkan_lvp\nleak:libLLVM\nleak:libVkLayer_khronos_validation\nleak:libdrm\n";
}
#endif

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
    // From now on threads have the stacks of these.
    std::array<std::thread, 32> threads;
    std::barrier all(static_cast<ptrdiff_t>(threads.size()));
    for (std::thread &thread : threads)
        thread = std::thread([&all] { all.arrive_and_wait(); });
    for (std::thread &thread : threads)
        thread.join();
}

// Folders where the loader looks for layers. VELLUM_TEST_LAYER names the folder of another build of Vellum's layer,
// such as a mutant (bench/mutants), that replaces this build's.
std::string layerFolders()
{
    const std::string folders = VELLUM_TEST_LAYER_PATH;
    const char *other = std::getenv("VELLUM_TEST_LAYER");
    return other ? other + folders.substr(folders.find(':')) : folders;
}

// ThreadSanitizer ends the process when a library goes that a suppression names (tests/tsan.supp), and knows no names
// of functions in others that have gone.
[[maybe_unused]] void keepLibrariesLoaded()
{
    const std::string folders = layerFolders();
    for (const std::string &name : {std::string("libvulkan_lvp.so"),
                                    folders.substr(0, folders.find(':')) + "/libVkLayer_vellum_opacity_micromap.so"})
        dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
}

} // namespace

int main(int argc, char **argv)
{
    if (argc == 2 && std::strcmp(argv[1], "--labels") == 0) {
        for (const vt::Labelled &row : vt::Labels::all())
            std::printf("%s %s\n", row.cases.c_str(), row.labels.c_str());
        return 0;
    }
#if defined(__SANITIZE_THREAD__)
    keepLibrariesLoaded();
#elif !defined(__SANITIZE_ADDRESS__)
    makeAddressesRepeat(argv);
#endif
    // VK_LAYER_PATH would hide VK_ADD_LAYER_PATH; implicit layers of this machine are not under test.
    unsetenv("VK_LAYER_PATH");
    unsetenv("VK_INSTANCE_LAYERS");
    setenv("VK_ADD_LAYER_PATH", layerFolders().c_str(), 1);
    setenv("VK_LOADER_LAYERS_DISABLE", "~implicit~", 1);
#ifdef VELLUM_TEST_ICD
    // Lavapipe, unless the environment names another driver's manifest (docs/conformance.md).
    const char *driver = std::getenv("VELLUM_TEST_DRIVER");
    setenv("VK_DRIVER_FILES", driver ? driver : VELLUM_TEST_ICD, 1);
    setenv("VK_ICD_FILENAMES", driver ? driver : VELLUM_TEST_ICD, 1);
#endif
    vellum::check::oracle::everyTriangleHasMicromap = std::getenv("VELLUM_FORCING") != nullptr;
    setenv("GALLIVM_PERF", "nopt", 0);
    setenv("MESA_SHADER_CACHE_DIR", VELLUM_TEST_SHADER_CACHE, 0);
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
