// SPDX-License-Identifier: Apache-2.0
// The extension as an application sees it, with Vellum's layer and without.
#include <algorithm>
#include <array>

#include "harness/harness.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kPropertiesLabels{
    {"Properties.*", "one_api"}, {"PropertiesNewer.*", "one_api"}, {"WithoutLayer.*", "one_api"}};

using vt::Gpu;

bool advertises(VkPhysicalDevice physical)
{
    uint32_t count = 0;
    vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> all(count);
    vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, all.data());
    int found = 0;
    for (const VkExtensionProperties &p : all) {
        if (std::strcmp(p.extensionName, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0) {
            EXPECT_EQ(p.specVersion, 2u);
            ++found;
        }
    }
    EXPECT_LE(found, 1) << "listed twice";
    return found > 0;
}

VkPhysicalDeviceOpacityMicromapFeaturesEXT featuresOf(VkPhysicalDevice physical)
{
    auto micromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &micromap});
    vkGetPhysicalDeviceFeatures2(physical, &features);
    return micromap;
}

VkResult createDevice(VkPhysicalDevice physical, std::span<const char *const> extensions, const void *chain,
                      VkDevice *device)
{
    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto info = vkInit<VkDeviceCreateInfo>({.pNext = chain,
                                            .queueCreateInfoCount = 1,
                                            .pQueueCreateInfos = &queue,
                                            .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                            .ppEnabledExtensionNames = extensions.data()});
    return vkCreateDevice(physical, &info, nullptr, device);
}

// Properties of VK_EXT_opacity_micromap; micromap_structure_test.cpp tests those of VK_KHR_opacity_micromap.
class Properties : public vt::GpuTest
{
protected:
    Properties() : GpuTest({.api = vt::Api::Ext}) {}
};

// Uses the extension that the tests use, on a device whose limits are simulated by settings.
class SimulatedLimits : public vt::GpuTest
{
protected:
    SimulatedLimits() : GpuTest({.validate = (setAll(), true)}) {}
    ~SimulatedLimits() override
    {
        for (const auto &[name, value] : kValues)
            unsetenv(name);
    }
    // The ids of what a build of one triangle reports. declared: the level in its usage counts.
    std::vector<std::string> reported(uint32_t level, uint32_t declared, uint16_t format,
                                      VkBuildMicromapFlagsEXT flags = 0)
    {
        vt::MicromapInput input;
        input.add(level, format, std::vector<uint8_t>(size_t{1} << 2 * level, 1));
        input.declared = {{1, declared, format}};
        vt::Micromap(gpu(), std::move(input), flags).build();
        std::vector<std::string> ids;
        for (const vt::Message &message : gpu().takeUnexpectedMessages())
            ids.push_back(message.id);
        return ids;
    }

private:
    static constexpr std::array<std::pair<const char *, const char *>, 3> kValues{
        {{"VELLUM_MAX_OPACITY_2_STATE_SUBDIVISION_LEVEL", "6"},
         {"VELLUM_MAX_OPACITY_4_STATE_SUBDIVISION_LEVEL", "4"},
         {"VELLUM_MAX_OPACITY_LOSSY_4_STATE_SUBDIVISION_LEVEL", "5"}}};
    static void setAll()
    {
        for (const auto &[name, value] : kValues)
            setenv(name, value, 1);
    }
};

TEST_F(SimulatedLimits, AreReported)
{
    EXPECT_EQ(gpu().maxLevel(vt::kTwoState), 6u);
    EXPECT_EQ(gpu().maxLevel(vt::kFourState), 4u);
    EXPECT_EQ(gpu().maxLossyLevel(), gpu().khr() ? 5u : 0u);
}

TEST_F(SimulatedLimits, AreValidated)
{
    using Ids = std::vector<std::string>;
    EXPECT_EQ(reported(6, 6, vt::kTwoState), Ids());
    EXPECT_EQ(reported(4, 4, vt::kFourState), Ids());
    // Checked in usage counts, and in the triangles that the device reads.
    EXPECT_NE(reported(7, 7, vt::kTwoState), Ids());
    EXPECT_NE(reported(5, 5, vt::kFourState), Ids());
    EXPECT_NE(reported(5, 4, vt::kFourState), Ids());
    if (gpu().khr()) {
        EXPECT_EQ(reported(5, 5, vt::kFourState, vt::kLossy), Ids());
        EXPECT_NE(reported(6, 6, vt::kFourState, vt::kLossy), Ids());
    }
}

class WithoutLayer : public vt::GpuTest
{
protected:
    WithoutLayer() : GpuTest({.vellum = false, .micromaps = false}) {}
};

TEST_F(Properties, ExtensionIsListedOnce)
{
    EXPECT_TRUE(advertises(gpu().physical()));
}

TEST_F(Properties, ListingInPiecesWorks)
{
    uint32_t total = 0;
    ASSERT_EQ(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &total, nullptr), VK_SUCCESS);
    std::vector<VkExtensionProperties> some(total - 1);
    uint32_t count = total - 1;
    EXPECT_EQ(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, some.data()), VK_INCOMPLETE);
    EXPECT_EQ(count, total - 1);
}

TEST_F(Properties, FeaturesAndLimits)
{
    const auto features = featuresOf(gpu().physical());
    EXPECT_TRUE(features.micromap);
    EXPECT_FALSE(features.micromapCaptureReplay);
    EXPECT_TRUE(features.micromapHostCommands);

    auto micromap = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesEXT>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &micromap});
    vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
    EXPECT_EQ(micromap.maxOpacity2StateSubdivisionLevel, 12u);
    EXPECT_EQ(micromap.maxOpacity4StateSubdivisionLevel, 12u);
}

// VK_ARM_pipeline_opacity_micromap: listed, its feature can be enabled, and nothing of it reaches the driver (the spy).
TEST_F(Properties, PipelinesWithoutMicromaps)
{
    const char *const name = "VK_ARM_pipeline_opacity_micromap";
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> list(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, list.data()));
    EXPECT_EQ(
        std::count_if(list.begin(), list.end(), [&](const auto &e) { return std::strcmp(e.extensionName, name) == 0; }),
        1);
    auto features = vkInit<VkPhysicalDevicePipelineOpacityMicromapFeaturesARM>();
    auto query = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &features});
    vkGetPhysicalDeviceFeatures2(gpu().physical(), &query);
    EXPECT_TRUE(features.pipelineOpacityMicromap);

    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.micromap = VK_TRUE});
    features.pNext = &micromaps;
    const std::array names{VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                           VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, name};
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(createDevice(gpu().physical(), names, &features, &device), VK_SUCCESS);
    vkDestroyDevice(device, nullptr);
    for (const vt::Message &m : gpu().takeUnexpectedMessages())
        EXPECT_EQ(m.text.find("icromap"), std::string::npos) << m.id << ": " << m.text;
}

TEST_F(Properties, TheFlagOfPipelinesStaysInTheLayer)
{
    // A compute shader that does nothing.
    constexpr std::array<uint32_t, 34> words{
        0x07230203, 0x00010000, 0,          5, 0,  0x00020011, 1, 0x0003000e, 0,          1, 0x0005000f, 5, 3,
        0x6e69616d, 0,          0x00060010, 3, 17, 1,          1, 1,          0x00020013, 1, 0x00030021, 2, 1,
        0x00050036, 1,          3,          0, 2,  0x000200f8, 4, 0x000100fd};
    std::vector<uint32_t> code(words.begin(), words.end());
    code.push_back(0x00010038);
    const VkShaderModule module = gpu().shader(code);
    auto layoutInfo = vkInit<VkPipelineLayoutCreateInfo>();
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineLayout(gpu().device(), &layoutInfo, nullptr, &layout));
    const auto flags =
        vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM});
    auto info = vkInit<VkComputePipelineCreateInfo>(
        {.pNext = &flags,
         .stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = layout});
    VkPipeline pipeline = VK_NULL_HANDLE;
    EXPECT_EQ(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), VK_SUCCESS);
    for (const vt::Message &m : gpu().takeUnexpectedMessages())
        EXPECT_NE(m.id, "SPY") << m.text; // the old validation layer does not know VkPipelineCreateFlags2CreateInfo
    EXPECT_EQ(flags.flags, VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM)
        << "the application's chain is const";
    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
    vkDestroyPipelineLayout(gpu().device(), layout, nullptr);
    vkDestroyShaderModule(gpu().device(), module, nullptr);
}

class PropertiesNewer : public vt::GpuTest
{
protected:
    PropertiesNewer() : GpuTest({.oldValidation = false, .api = vt::Api::Ext, .newer = true}) {}
};

// VK_BUFFER_USAGE_2_MICROMAP_... replace the flags in the create info: a micromap is created on such a buffer, and the
// spy reports if the driver receives them.
TEST_F(PropertiesNewer, BufferUsageInTheChain)
{
    if (!gpu().has("VK_KHR_maintenance5"))
        GTEST_SKIP() << "no VkBufferUsageFlags2CreateInfo";
    const VkFlags64 wanted = VkFlags64{VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT} |
                             VkFlags64{VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT} |
                             VkFlags64{VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT};
    const auto usage = vkInit<VkBufferUsageFlags2CreateInfoKHR>({.usage = wanted});
    auto info = vkInit<VkBufferCreateInfo>({.pNext = &usage, .size = 4096});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
    EXPECT_EQ(usage.usage, wanted) << "the application's chain is const";
    auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = buffer, .size = 4096});
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    EXPECT_EQ(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap), VK_SUCCESS);
    gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
    expectNoMessages();
}

TEST_F(Properties, EveryEntryPointResolves)
{
    for (const char *name :
         {"vkCreateMicromapEXT", "vkDestroyMicromapEXT", "vkCmdBuildMicromapsEXT", "vkBuildMicromapsEXT",
          "vkCopyMicromapEXT", "vkCopyMicromapToMemoryEXT", "vkCopyMemoryToMicromapEXT",
          "vkWriteMicromapsPropertiesEXT", "vkCmdCopyMicromapEXT", "vkCmdCopyMicromapToMemoryEXT",
          "vkCmdCopyMemoryToMicromapEXT", "vkCmdWriteMicromapsPropertiesEXT", "vkGetDeviceMicromapCompatibilityEXT",
          "vkGetMicromapBuildSizesEXT"}) {
        EXPECT_NE(vkGetDeviceProcAddr(gpu().device(), name), nullptr) << name;
        EXPECT_NE(vkGetInstanceProcAddr(gpu().instance(), name), nullptr) << name;
    }
}

TEST_F(Properties, UnknownEntryPointsDoNotResolve)
{
    EXPECT_EQ(vkGetDeviceProcAddr(gpu().device(), "vkCmdNoSuchThingEXT"), nullptr);
}

TEST_F(Properties, EntryPointsStayHiddenWhereTheExtensionIsNotEnabled)
{
    Gpu plain({.micromaps = false});
    EXPECT_EQ(vkGetDeviceProcAddr(plain.device(), "vkCreateMicromapEXT"), nullptr);
    EXPECT_NE(vkGetDeviceProcAddr(plain.device(), "vkCmdDispatch"), nullptr);
}

TEST_F(Properties, EnablingAMissingFeatureFails)
{
    auto wanted =
        vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.micromap = VK_TRUE, .micromapCaptureReplay = VK_TRUE});
    const std::array names{VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                           VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(createDevice(gpu().physical(), names, &wanted, &device), VK_ERROR_FEATURE_NOT_PRESENT);
    vkDestroyDevice(device, nullptr);
    gpu().takeMessages(); // reports of it are correct
}

// The layer enables bufferDeviceAddress, but not in a structure that it cannot change.
TEST_F(Properties, AddressesBehindAnUnknownStructure)
{
    auto addresses = vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>();
    const VkBaseInStructure unknown{static_cast<VkStructureType>(0x7ffffff0),
                                    reinterpret_cast<const VkBaseInStructure *>(&addresses)};
    const std::array names{VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                           VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    for (const bool enabled : {false, true}) {
        addresses.bufferDeviceAddress = VkBool32{enabled};
        VkDevice device = VK_NULL_HANDLE;
        EXPECT_EQ(createDevice(gpu().physical(), names, &unknown, &device),
                  enabled ? VK_SUCCESS : VK_ERROR_FEATURE_NOT_PRESENT);
        vkDestroyDevice(device, nullptr);
        const std::vector<vt::Message> messages = gpu().takeUnexpectedMessages();
        const auto errors = std::ranges::count(messages, std::string("VELLUM-device-features"), &vt::Message::id);
        EXPECT_EQ(errors, enabled ? 0 : 1);
    }
}

TEST_F(Properties, CompatibilityOfVersionData)
{
    const std::array<uint8_t, 2 * VK_UUID_SIZE> foreign{1, 2, 3};
    auto version = vkInit<VkMicromapVersionInfoEXT>({.pVersionData = foreign.data()});
    auto compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_MAX_ENUM_KHR;
    gpu().vk().GetDeviceMicromapCompatibilityEXT(gpu().device(), &version, &compatibility);
    EXPECT_EQ(compatibility, VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR);
}

TEST_F(WithoutLayer, TheDriverHasNoMicromaps)
{
    if (advertises(gpu().physical()))
        GTEST_SKIP() << "this driver has micromaps of its own";
    EXPECT_FALSE(featuresOf(gpu().physical()).micromap);
    const std::array names{VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                           VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(createDevice(gpu().physical(), names, nullptr, &device), VK_ERROR_EXTENSION_NOT_PRESENT);
    gpu().takeMessages();
}

} // namespace
