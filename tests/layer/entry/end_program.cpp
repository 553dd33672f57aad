// SPDX-License-Identifier: Apache-2.0
// An application that ends without destroying what it made. It takes Vulkan by dlopen(), so that the loader can go too.
// usage: vellum_end_program WAY THREADS [LAYER...]; the first layer is the nearest to the application.
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <thread>
#include <vector>

#include <dlfcn.h>
#include <sys/wait.h>
#include <unistd.h>

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan.h>

#include "micromap_device.h"

namespace
{

[[noreturn]] void fail(const char *what)
{
    std::fprintf(stderr, "vellum_end_program: %s\n", what);
    std::_Exit(2);
}

void check(VkResult result, const char *what)
{
    if (result != VK_SUCCESS)
        fail(what);
}

struct Loader {
    void *library = dlopen("libvulkan.so.1", RTLD_NOW | RTLD_LOCAL);
    PFN_vkGetInstanceProcAddr get = nullptr;

    Loader()
    {
        if (library == nullptr)
            fail(dlerror());
        get = reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library, "vkGetInstanceProcAddr"));
    }
    template <class Function>
    Function find(VkInstance instance, const char *name) const
    {
        const auto function = reinterpret_cast<Function>(get(instance, name));
        if (function == nullptr)
            fail(name);
        return function;
    }
};
#define COMMAND(name) loader.find<PFN_##name>(instance, #name)

VkInstance makeInstance(const Loader &loader, const std::vector<const char *> &layers)
{
    VkInstance instance = VK_NULL_HANDLE;
    auto application = vkInit<VkApplicationInfo>({.apiVersion = VK_API_VERSION_1_3});
    auto info = vkInit<VkInstanceCreateInfo>({.pApplicationInfo = &application,
                                              .enabledLayerCount = static_cast<uint32_t>(layers.size()),
                                              .ppEnabledLayerNames = layers.data()});
    check(COMMAND(vkCreateInstance)(&info, nullptr, &instance), "vkCreateInstance");
    return instance;
}

VkDevice makeDevice(const Loader &loader, VkInstance instance)
{
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    uint32_t count = 1;
    if (COMMAND(vkEnumeratePhysicalDevices)(instance, &count, &physical) < 0 || count == 0)
        fail("vkEnumeratePhysicalDevices");
    VkDevice device = VK_NULL_HANDLE;
    check(COMMAND(vkCreateDevice)(physical, MicromapDeviceInfo(0).get(), nullptr, &device), "vkCreateDevice");
    // Queries of micromaps are the layer's own, and have memory of the driver's.
    auto pool =
        vkInit<VkQueryPoolCreateInfo>({.queryType = VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, .queryCount = 16});
    VkQueryPool queries = VK_NULL_HANDLE;
    check(COMMAND(vkCreateQueryPool)(device, &pool, nullptr, &queries), "vkCreateQueryPool");
    return device;
}

// Threads that have been in the layer, are there again and again while `busy`, and are left to themselves.
class Threads
{
public:
    Threads(size_t count, const Loader &loader, VkInstance instance, VkDevice device)
    {
        const auto sizes = COMMAND(vkGetMicromapBuildSizesEXT);
        for (size_t i = 0; i < count; ++i) {
            std::thread([this, sizes, device] {
                do {
                    const auto build = vkInit<VkMicromapBuildInfoEXT>();
                    auto result = vkInit<VkMicromapBuildSizesInfoEXT>();
                    sizes(device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, &result);
                    ++calls_;
                } while (busy_);
                ++resting_;
            }).detach();
        }
        while (calls_ < count)
            std::this_thread::yield();
    }
    // After this call, no thread is in the layer.
    void rest(size_t count)
    {
        busy_ = false;
        while (resting_ < count)
            std::this_thread::yield();
    }

private:
    std::atomic<bool> busy_ = true;
    std::atomic<size_t> calls_ = 0, resting_ = 0;
};

// Lavapipe 26 waits at exit for a thread that a forked process does not have, without layers as well.
bool hangsAfterFork(const Loader &loader, VkInstance instance)
{
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    COMMAND(vkEnumeratePhysicalDevices)(instance, &count, &physical);
    VkPhysicalDeviceProperties properties{};
    COMMAND(vkGetPhysicalDeviceProperties)(physical, &properties);
    return std::string_view(properties.deviceName).starts_with("llvmpipe") &&
           properties.driverVersion >= VK_MAKE_API_VERSION(0, 26, 0, 0);
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 3)
        fail("usage: vellum_end_program WAY THREADS [LAYER...]");
    const std::string_view way = argv[1];
    const size_t count = std::strtoul(argv[2], nullptr, 10);
    const std::vector<const char *> layers(argv + 3, argv + argc);
    const Loader loader;
    VkInstance instance = makeInstance(loader, layers);
    if (way == "instances") { // one after the other: the loader unloads its layers with each
        for (size_t i = 0; i < count; ++i) {
            COMMAND(vkDestroyInstance)(instance, nullptr);
            instance = makeInstance(loader, layers);
        }
        return 0;
    }
    VkDevice device = makeDevice(loader, instance);
    static Threads threads(count, loader, instance, device); // may outlive main()
    if (way == "exit")
        return 0;
    if (way == "_exit")
        _exit(0);
    if (way == "fork" && hangsAfterFork(loader, instance))
        _exit(77); // tests/layer/entry/end_test.cpp
    if (way == "fork") {
        const pid_t child = fork();
        if (child == 0)
            std::exit(0);
        int status = -1;
        if (child < 0 || waitpid(child, &status, 0) != child || status != 0)
            fail("the forked process");
        threads.rest(count);
        COMMAND(vkDeviceWaitIdle)(device);
        return 0;
    }
    threads.rest(count);
    if (way == "instance" || way == "dlclose-after-instance") {
        COMMAND(vkDestroyInstance)(instance, nullptr);
        if (way == "instance") { // a later one is not confused with the destroyed one
            instance = makeInstance(loader, layers);
            device = makeDevice(loader, instance);
            COMMAND(vkDeviceWaitIdle)(device);
            return 0;
        }
    } else if (way == "second-instance") { // and the layer stays loaded meanwhile
        const VkInstance other = makeInstance(loader, layers);
        COMMAND(vkDestroyInstance)(instance, nullptr);
        for (int i = 0; i < 20; ++i) {
            const VkDevice second = makeDevice(loader, other);
            instance = other;
            COMMAND(vkDeviceWaitIdle)(second);
        }
        return 0;
    } else if (way != "dlclose") {
        fail("there is no such way");
    }
    dlclose(loader.library);
    return 0;
}
