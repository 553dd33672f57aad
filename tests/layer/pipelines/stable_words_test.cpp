// SPDX-License-Identifier: Apache-2.0
// A driver's caches identify shaders by their words. Rewritten words must be the same in every run where the driver
// lets the layer choose the addresses in them.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "gpu/tracer.h"
#include "harness/harness.h"

using namespace vt;

namespace
{

namespace fs = std::filesystem;

Options plain()
{
    Options options;
    options.validation = false;
    options.spy = false;
    return options;
}

bool choosesAddresses(VkPhysicalDevice device)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    uint32_t count = 0;
    vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> extensions(count);
    vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data());
    return properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU &&
           std::any_of(extensions.begin(), extensions.end(), [](const VkExtensionProperties &e) {
               return std::string_view(e.extensionName) == VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME;
           });
}

// Run by the test below, in processes of its own. Two devices at a time have two addresses.
TEST(StableWords, DISABLED_Run)
{
    Gpu first(plain());
    Gpu second(plain());
    const Tracer a(first);
    const Tracer b(second);
}

// Rewritten modules by the names of the files that the layer dumps them to.
std::map<std::string, std::string> wordsOfARun(const fs::path &folder)
{
    fs::create_directories(folder);
    const std::string command = "VELLUM_DUMP_SHADERS='" + folder.string() + "' '" +
                                fs::read_symlink("/proc/self/exe").string() +
                                "' --gtest_filter=StableWords.DISABLED_Run --gtest_also_run_disabled_tests > '" +
                                (folder / "log").string() + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::map<std::string, std::string> words;
    for (const auto &entry : fs::directory_iterator(folder)) {
        if (!entry.path().string().ends_with(".after.spv"))
            continue;
        std::ifstream file(entry.path(), std::ios::binary);
        words[entry.path().filename()] = {std::istreambuf_iterator<char>(file), {}};
    }
    return words;
}

TEST(StableWords, SameInEveryRun)
{
    if (!choosesAddresses(Gpu(plain()).physical()))
        GTEST_SKIP() << "the driver chooses the addresses";
    const fs::path folder = fs::temp_directory_path() / ("vellum-words-" + std::to_string(getpid()));
    const auto first = wordsOfARun(folder / "1");
    const auto second = wordsOfARun(folder / "2");
    ASSERT_EQ(first.size(), 2u);
    EXPECT_TRUE(first == second);
    // They contain an address, which each device chooses.
    EXPECT_NE(first.begin()->second, first.rbegin()->second);
    if (!HasFailure())
        fs::remove_all(folder);
}

} // namespace
