// SPDX-License-Identifier: Apache-2.0
// The setting `implementation` on drivers with and without micromaps of their own.
#include <cstdlib>
#include <cstring>

#include "command_buffer/state_scene.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kImplementationLabels{{"ImplementationSetting.*", "one_api"}};

using namespace vt;

// The extensions that an instance with the setting offers.
struct Offer {
    bool ext = false, khr = false;
    std::string description; // of the tool
    bool operator==(const Offer &) const = default;
};

class Setting
{
public:
    explicit Setting(const char *value) { setenv(kName, value, 1); }
    ~Setting() { unsetenv(kName); }
    Setting(const Setting &) = delete;
    Setting &operator=(const Setting &) = delete;

private:
    static constexpr const char *kName = "VELLUM_IMPLEMENTATION";
};

std::string descriptionOf(VkPhysicalDevice device)
{
    uint32_t count = 0;
    VT_CHECK(vkGetPhysicalDeviceToolProperties(device, &count, nullptr));
    std::vector<VkPhysicalDeviceToolProperties> tools(count, vkInit<VkPhysicalDeviceToolProperties>());
    VT_CHECK(vkGetPhysicalDeviceToolProperties(device, &count, tools.data()));
    for (const VkPhysicalDeviceToolProperties &tool : tools)
        if (std::strcmp(tool.layer, "VK_LAYER_VELLUM_opacity_micromap") == 0)
            return tool.description;
    return "no tool";
}

Offer offerOf(const char *setting, const std::string &quirks)
{
    const Setting environment(setting);
    Gpu gpu(Options{.validation = false, .spy = false, .quirks = quirks, .micromaps = false});
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> all(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, all.data()));
    const auto lists = [&all](const char *name) {
        return std::ranges::any_of(all, [name](const auto &e) { return std::strcmp(e.extensionName, name) == 0; });
    };
    return {lists(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME), lists(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME),
            descriptionOf(gpu.physical())};
}

TEST(ImplementationSetting, DriversWithoutMicromaps)
{
    for (const char *setting : {"auto", "ext", "emulated"})
        EXPECT_EQ(offerOf(setting, ""), (Offer{true, true, "emulated"})) << setting;
    EXPECT_EQ(offerOf("driver", ""), (Offer{false, false, "not available on this device"}));
}

// The loader adds the extensions of an implicit layer to the list of the driver.
TEST(ImplementationSetting, ImplicitLayer)
{
    for (const char *setting : {"auto", "ext", "emulated"})
        EXPECT_EQ(offerOf(setting, "implicit"), (Offer{true, true, "emulated"})) << setting;
    EXPECT_EQ(offerOf("driver", "implicit"), (Offer{false, false, "not available on this device"}));
    Gpu gpu(Options{.validation = false, .quirks = "implicit"});
    StateScene scene(gpu);
    gpu.submit([&](VkCommandBuffer commands) { scene.record(commands); });
    scene.expectRight();
}

TEST(ImplementationSetting, DriversWithExt)
{
    for (const char *setting : {"auto", "ext"})
        EXPECT_EQ(offerOf(setting, "ext"), (Offer{true, true, "translated"})) << setting;
    EXPECT_EQ(offerOf("driver", "ext"), (Offer{true, false, "passthrough"}));
    EXPECT_EQ(offerOf("emulated", "ext"), (Offer{true, true, "emulated"}));
}

TEST(ImplementationSetting, DriversWithBoth)
{
    // VK_ARM_pipeline_opacity_micromap, which the driver lacks, is emulated.
    EXPECT_EQ(offerOf("auto", "ext,khr"), (Offer{true, true, "emulated"}));
    EXPECT_EQ(offerOf("driver", "ext,khr"), (Offer{true, true, "passthrough"}));
    EXPECT_EQ(offerOf("ext", "ext,khr"), (Offer{true, true, "translated"}));
    EXPECT_EQ(offerOf("emulated", "ext,khr"), (Offer{true, true, "emulated"}));
}

// The layer rejects the host commands of acceleration structures on a device on which it emulates an extension, though
// the driver has the others.
TEST(ImplementationSetting, HostCommandsWithOneEmulatedExtension)
{
    Gpu gpu(Options{.validation = false, .spy = false, .quirks = "ext,khr,capable", .micromaps = false});
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &structures});
    vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
    EXPECT_TRUE(structures.accelerationStructureHostCommands);
    auto pipelines = vkInit<VkPhysicalDevicePipelineOpacityMicromapFeaturesARM>();
    structures.pNext = &pipelines;
    vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
    EXPECT_TRUE(pipelines.pipelineOpacityMicromap);
    EXPECT_FALSE(structures.accelerationStructureHostCommands);
}

// The driver builds KHR's micromaps by the commands of EXT, or never sees any.
TEST(ImplementationSetting, TheChosenOneBuilds)
{
    const auto builds = testDriverFunction<uint64_t (*)()>("vellumExtBuilds");
    for (const char *setting : {"auto", "ext", "emulated"}) {
        const Setting environment(setting);
        Gpu gpu(Options{.validation = false, .spy = false, .quirks = "ext,khr", .api = Api::Khr});
        const uint64_t before = builds();
        StateScene scene(gpu);
        gpu.submit([&](VkCommandBuffer commands) { scene.record(commands); });
        scene.expectRight();
        EXPECT_EQ(builds() > before, std::strcmp(setting, "ext") == 0) << setting;
        gpu.takeMessages(); // of the device
    }
}

} // namespace
